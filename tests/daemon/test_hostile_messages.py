"""Messages made to harm: none is believed, none is obeyed, and whoever asks properly is answered meanwhile."""

import json
import random
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

import pytest
import zmq
from hypothesis import given, settings
from hypothesis import strategies as st

from pzctl import connect
from pzctl.daemon.audience import MOST_SUBSCRIPTIONS
from pzctl.daemon.frames import MOST_FRAMES, WireError
from pzctl.daemon.paths import home, log_file
from pzctl.daemon.reception import NAMES, _read
from pzctl.daemon.wire import decode
from pzctl.models.build import Build

FOLDER = Path(__file__).parents[1] / "wire" / "v1"


def golden() -> dict[str, list[bytes]]:
    """Every message of wire 1, as frames."""
    found: dict[str, list[bytes]] = {}
    for path in sorted(FOLDER.glob("*.frames")):
        data, frames = path.read_bytes(), []
        while data:
            length = int.from_bytes(data[:4], "little")
            frames.append(data[4 : 4 + length])
            data = data[4 + length :]
        found[path.stem] = frames
    return found


GOLDEN = golden()
SHAPES = ([10**12], [2**62, 4], [-1], [0] * 50, ["801"], [801.0], [], [3, 0])
DTYPES = ("<f8", "<c16", ">f8", "O", "<U9", "|V8", "object")


def mutated(seed: int) -> list[bytes]:
    """A message of wire 1, harmed in one of the ways that harm programs."""
    chance = random.Random(seed)  # noqa: S311
    frames = list(chance.choice(list(GOLDEN.values())))
    way = chance.randrange(7)
    k = chance.randrange(len(frames))
    if way == 0:
        frames[k] = frames[k][: chance.randrange(len(frames[k]) + 1)]
    elif way == 1 and frames[k]:
        at = chance.randrange(len(frames[k]))
        frames[k] = frames[k][:at] + chance.randbytes(chance.randrange(1, 9)) + frames[k][at + 1 :]
    elif way == 2:
        frames = [chance.randbytes(chance.randrange(200)) for _ in range(chance.randrange(1, 6))]
    elif way == 3:
        frames += [b""] * chance.choice((1, 3, MOST_FRAMES))
    elif way == 4:
        frames[min(k, 1)] = b'{"id":"x","request":' + b"[" * chance.choice((10, 100_000))
    else:
        head = 0 if b'"request"' in frames[0] else 1
        header = json.loads(frames[head])
        columns = [{"name": "frequency", "unit": "Hz", "dtype": chance.choice(DTYPES), "shape": chance.choice(SHAPES)}]
        key = chance.choice(("columns", "id", "v", "seq", "since", "build", "sample", "measurement", "curves"))
        header[key] = chance.choice((columns, None, -1, 2**70, "../../../etc/passwd", {"a": [{}] * 100}, "x" * 10_000))
        frames[head] = json.dumps(header).encode()
    return frames


@settings(deadline=None, max_examples=500)
@given(st.integers(0, 2**32))
def test_readers_say_what_is_wrong_or_read(seed: int) -> None:
    frames = mutated(seed)
    for read in (decode, _read):
        with suppress(WireError):  # anything else that it raises is a defect
            read(frames)


@pytest.fixture
def sender() -> "Iterator[zmq.Socket[bytes]]":
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.DEALER) as link:
        link.setsockopt(zmq.LINGER, 0)
        link.setsockopt(zmq.RCVTIMEO, 20_000)
        yield link
    context.term()


def test_the_daemon_answers_all_of_it_and_goes_on(start_daemon, build: Build, sender) -> None:
    where = start_daemon()
    sender.connect(where.requests)
    obeyed = (b'"shutdown"', b'"lease"')  # one that is still whole ends the daemon, or takes the instrument
    harmless = [frames for frames in map(mutated, range(1500)) if not any(word in frames[0] for word in obeyed)]
    answered = 0
    with connect() as lab:
        for k, frames in enumerate(harmless):
            sender.send_multipart(frames if frames[0] else [b"x", *frames])
            answered += not json.loads(sender.recv_multipart()[0])["ok"]
            if k % 500 == 0:
                assert lab.status().seq > 0
        assert answered > 1000
        assert lab.metrics().counts["garbage"] > 500
        assert lab.measure(build, "disk").sweeps


def test_who_subscribes_without_end_is_cut_off(start_daemon, build: Build, wait_until, tmp_path: Path) -> None:
    where = start_daemon()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with connect() as lab, context.socket(zmq.XSUB) as link:
        link.setsockopt(zmq.LINGER, 0)
        link.connect(where.events)
        for k in range(MOST_SUBSCRIPTIONS + 1):
            link.send(b"\1" + str(k).encode())
        wait_until(lambda: "was cut off: it subscribes to more than" in log_file(tmp_path, "daemon").read_text())
        assert lab.measure(build, "disk").sweeps, "the others hear"
    context.term()


@pytest.mark.parametrize("name", ["../../../escape", "/tmp/escape", "a\0b", "..", "x" * 5000])  # noqa: S108
def test_no_name_leads_out_of_the_data_folder(start_daemon, build: Build, name: str) -> None:
    start_daemon("Echo")
    with connect() as lab:
        before = set(home().parent.iterdir())
        lab.measure(replace(build, name=name), "disk")
        assert set(home().parent.iterdir()) == before
        assert lab.samples(name)[0].name == name


def test_every_request_is_known_by_the_docs() -> None:
    text = (Path(__file__).parents[2] / "docs" / "wire.md").read_text(encoding="utf-8")
    assert not [name for name in NAMES if f"| `{name}` |" not in text]
