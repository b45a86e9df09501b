"""A million mutated answers through the driver's parsers: a value of the right kind, or one sentence (`make bench`)."""

import math
import random
import time
from collections import Counter

import numpy as np

from pzctl.drivers.agilent4294a.protocol.error_queue import queued_error
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.drivers.visa import replies

BLOCK = b"#6000048" + np.array([1.5, -2e3, 1e-9, 4e6, 5, -6], ">f8").tobytes()

PARSERS = [
    ("number", b"+1.10000000000E+08", lambda b: math.isfinite(replies.number(b.decode("latin-1"), "STAR?"))),
    ("integer", b"+201", lambda b: isinstance(replies.integer(b.decode("latin-1"), "POIN?"), int)),
    ("flag", b"1", lambda b: isinstance(replies.flag(b.decode("latin-1"), "DCO?"), bool)),
    ("word", b"FREQ", lambda b: replies.word(b.decode("latin-1"), "SWPP?", ("FREQ", "OLEV")) in ("FREQ", "OLEV")),
    (
        "error",
        b'-113,"UNDEFINED HEADER"',
        lambda b: queued_error(b.decode("latin-1"), "OUTPERRO?").number < 1e6,
    ),
    ("header", BLOCK[:8], lambda b: 0 <= replies.block_length(b, 6, "OUTPDATA?") < 1e6),
    ("doubles", BLOCK[8:], lambda b: bool(np.isfinite(replies.doubles(b, 6, "OUTPDATA?")).all())),
]


def mutated(data: bytes, rng: random.Random) -> bytes:
    out = bytearray(data)
    for _ in range(rng.randint(1, 3)):
        at = rng.randrange(len(out) + 1)
        what = rng.random()
        if what < 0.4 and at < len(out):
            out[at] = rng.randrange(256)
        elif what < 0.6:
            out[at:at] = bytes([rng.choice(b"+-0123456789.,;E#\n\r\"'nNaAiIfF \x00\xff")])
        elif what < 0.8:
            del out[at : at + rng.randint(1, 4)]
        else:
            out[at:] = out[at:] * 2
    return bytes(out)


def test_a_million_mutated_answers():
    rng, outcomes, begun = random.Random(4294), Counter(), time.perf_counter()  # noqa: S311
    for _ in range(1_000_000 // len(PARSERS) + 1):
        for name, valid, parse in PARSERS:
            try:
                assert parse(mutated(valid, rng))
                outcomes[name, "value"] += 1
            except InstrumentError:
                outcomes[name, "sentence"] += 1
    print(f"\n{sum(outcomes.values())} mutated answers in {time.perf_counter() - begun:.0f} s")
    for name, _, _ in PARSERS:
        print(f"{name:8} {outcomes[name, 'sentence']:7} refused, {outcomes[name, 'value']:7} still of the right form")
