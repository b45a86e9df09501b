"""Three ways through the tool, start to end, as sessions: what was typed, and what is expected to come.

In a `.session` file, a line that begins with `$ ` is typed in a shell, one with `>>> ` in Python, and one with `< `
answers the questions of the command before it. The lines below it must come in this order, among others; `...` stands
for anything. `[exit 3]` is the expected exit status, 0 if none is written. Everything else is for the reader.
"""

import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from pzctl.daemon.cli.commands import app
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.models.base.errors import PzctlError

HERE = Path(__file__).parent
SESSIONS = sorted(path.stem for path in HERE.glob("*.session"))


@dataclass
class Entry:
    """Something typed, and what is to come."""

    typed: str
    answers: list[str] = field(default_factory=list)
    expected: list[str] = field(default_factory=list)
    status: int = 0


def entries(text: str) -> list[Entry]:
    """Return what is typed in a session. A blank line ends what is expected."""
    found: list[Entry] = []
    current: Entry | None = None
    for line in text.splitlines():
        if line.startswith(("$ ", ">>> ")):
            found.append(current := Entry(line))
        elif not line.strip() or current is None:
            current = None
        elif line.startswith("< "):
            current.answers.append(line[2:])
        elif status := re.fullmatch(r"\[exit (\d)\]", line):
            current.status = int(status[1])
        else:
            current.expected.append(line.strip())
    return found


def came(output: str, expected: list[str]) -> str | None:
    """Return the first expected line that did not come, or None."""
    at = 0
    for line in expected:
        pattern = r"[^\n]*".join(map(re.escape, line.split("...")))
        match = re.compile(pattern).search(output, at)
        if match is None:
            return line
        at = match.end()
    return None


def shell(entry: Entry) -> tuple[int, str]:
    """Return exit status and output of a command, an error as the sentence that `pzctl` prints."""
    done = CliRunner().invoke(app, shlex.split(entry.typed)[2:], input="\n".join([*entry.answers, *[""] * 20]))
    if isinstance(done.exception, PzctlError):
        return done.exception.exit_status, f"{done.output}pzctl: {done.exception}"
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.output


def python(entry: Entry, names: dict[str, Any], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Return 0 and what a line of Python prints."""
    exec(entry.typed[4:], names)  # noqa: S102 (the lines of this folder's sessions)
    return 0, capsys.readouterr().out


def put_files(folder: Path) -> None:
    """Write what the sessions find: builds with few points, and recordings of a disk as people keep them."""
    quick = THESIS_BUILD.read_text(encoding="utf-8").replace("points = 801", "points = 101")
    (folder / "build.toml").write_text(quick, encoding="utf-8")
    build = read_build(folder / "build.toml")
    f = np.linspace(2e6, 6e6, 51)
    noise = np.random.default_rng(1).normal(scale=3e-4, size=(2, 2, f.size))
    bare = stack_of(build, build.step("disk")).impedance(f)
    for k, (name, Z) in enumerate((("Scheibe.csv", bare), ("nachher.csv", bare + 2j * np.pi * f * 40e-9))):
        recorded = Z * np.exp(noise[k, 0] + 1j * noise[k, 1])
        rows = zip(f / 1e6, np.abs(recorded), np.degrees(np.angle(recorded)), strict=True)
        text = "\n".join(";".join(f"{number:.8f}".replace(".", ",") for number in row) for row in rows)
        (folder / name).write_text(f"Frequenz / MHz;Impedanz / Ohm;Phasenwinkel / °\n{text}\n", encoding="utf-8")
        if name == "Scheibe.csv":
            np.savetxt(folder / "bare.txt", np.stack((f, recorded.real, recorded.imag), 1))
    for name in ("night.toml", "spec.toml"):
        (folder / name).write_bytes((HERE / name).read_bytes())


@pytest.mark.system
@pytest.mark.parametrize("name", SESSIONS)
def test_a_session(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path / "home"))
    monkeypatch.setenv("COLUMNS", "180")
    put_files(tmp_path)
    names: dict[str, Any] = {}
    for entry in entries((HERE / f"{name}.session").read_text(encoding="utf-8")):
        status, output = shell(entry) if entry.typed.startswith("$") else python(entry, names, capsys)
        assert status == entry.status, f"{entry.typed}\n{output}"
        missing = came(output, entry.expected)
        assert missing is None, f"{entry.typed}\ndid not print: {missing}\nbut\n{output}"
        assert "Traceback" not in output
