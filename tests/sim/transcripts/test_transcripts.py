"""Complete message sequences of other programs and of the manual's examples."""

import re
from pathlib import Path

import numpy as np
import pytest

TEXT = (Path(__file__).parent / "transcripts.md").read_text(encoding="utf-8")
PROGRAMS = dict(re.findall(r"^## (.+?)\n\n(.*?)(?=^## |\Z)", TEXT, re.DOTALL | re.MULTILINE))
DTYPES = {2: ">f4", 3: ">f8", 5: "<f4"}
WIDTH = {"OUTPSWPRM": 1, "OUTPDTRC": 2, "OUTPDATA": 2, "OUTPMTRC": 2, "OUTPVAC": 1, "OUTPIAC": 1, "OUTPDC": 1}
"""Numbers that an array has at each point."""
ZERO = ("OUTPDC",)
"""Arrays that may be all 0: no direct current flows through a ceramic."""
BLOCKS = (*WIDTH, "OUTPCOMC1", "OUTPCOMC2", "OUTPCOMC3", "OUTPCERR", "OUTPLIMF", "OUTPLIML")


class Player:
    """Sends a program's messages and compares the answers with the expected ones."""

    def __init__(self, wire) -> None:
        self.wire = wire
        self.form = 4
        self.answers: dict[str, bytes] = {}

    def play(self, step: str) -> None:
        message, _, wanted = step.partition(" -> ")
        data = re.sub(rb"\{(\w+)\}", lambda found: self.answers[found[1].decode()], message.encode())
        self.wire.say(data + b"\n")
        for unit in message.split(";"):
            words = unit.strip().upper().split(" ")
            self.form = {"*RST": 4, "PRES": 4, **{f"FORM{k}": k for k in (2, 3, 4, 5)}}.get(words[0], self.form)
            if words[0].endswith("?"):
                self.answered(words[0][:-1], wanted)

    def answered(self, name: str, wanted: str) -> None:
        block = name == "READ" or (self.form != 4 and name in BLOCKS)
        answer = self.block() if block else self.wire.line().encode().removesuffix(b"\n")
        self.answers[name] = answer
        if wanted:
            assert re.fullmatch(wanted, answer.decode("latin-1")), f"{name}? answered {answer[:80]!r}, not {wanted}"
        elif name in WIDTH:
            self.check_array(name, answer)
        elif name == "*OPC":
            assert answer == b"1"
        elif name == "OUTPERRO":
            assert re.fullmatch(rb'-?\d+,".+"', answer)
        else:
            assert answer or name in ("READ", "FNAME"), name

    def block(self) -> bytes:
        head = self.wire.stream.read(8)
        assert head[:2] == b"#6"
        data = self.wire.stream.read(int(head[2:]))
        assert self.wire.stream.read(1) == b"\n"
        return head + data

    def check_array(self, name: str, answer: bytes) -> None:
        if self.form == 4:
            values = np.array([float(v) for v in answer.split(b",")])
        else:
            values = np.frombuffer(answer[8:], DTYPES[self.form])
        assert values.size == WIDTH[name] * int(self.wire.ask("POIN?")), name
        assert np.any(values) or name in ZERO, f"{name}? is all 0"


@pytest.mark.parametrize("name", PROGRAMS)
def test_a_program_runs_to_its_end(lab, name: str) -> None:
    wire = lab.wire()
    wire.say("*CLS")
    player = Player(wire)
    text = PROGRAMS[name]
    for step in re.findall(r"`([^`]+)`", text.partition("Errors: ")[0]):
        player.play(step)
    allowed = re.findall(r"-?\d+", text.partition("Errors: ")[2].partition("(")[0])
    assert [e.split(",")[0] for e in wire.errors()] == allowed
