"""Malicious messages and endless bytes for the tests and for the flood benchmarks."""

import json
import random
from pathlib import Path

import raw_peer

from pzctl.daemon.wire.frames import MOST_FRAMES

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
    """A message of wire 1, damaged in one of several ways."""
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


ENDLESS = {
    "empty frames": (b"DEALER", raw_peer.MORE + b"\0"),
    "short frames": (b"DEALER", raw_peer.MORE + b"\x7d" + bytes(125)),
    "the longest frames": (b"DEALER", raw_peer.LARGE + (8 << 20).to_bytes(8, "big") + bytes(8 << 20)),
    "subscriptions": (b"SUB", b"".join(b"\0\5\1" + k.to_bytes(4, "big") for k in range(10_000))),
    "the same subscription": (b"SUB", b"\0\2\1x"),
    "what is taken back": (b"SUB", b"\0\2\0x"),
}
