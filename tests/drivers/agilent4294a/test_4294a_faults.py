"""A fault during a measurement gives a complete correct sweep or a clear error, never wrong data.

This file tests some positions of the fault; tests/benchmarks tests all of them.
"""

import json
import socket
import time
from dataclasses import dataclass

import numpy as np
import pytest

from pzctl.drivers import open_analyzer
from pzctl.drivers.base.analyzer import InstrumentError
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.server import SimOptions, running

PLAN = SweepPlan((Segment(1e6, 6e6, 21),), oscillator_V=0.3, bandwidth=2, bias_V=4.0)
JOINED = SweepPlan((Segment(1e6, 2e6, 11), Segment(3e6, 6e6, 11)), oscillator_V=0.3, bandwidth=2, joined=True)
"""A list sweep where the instrument takes one."""
SILENT_SECONDS, ANSWER_SECONDS = 0.25, 5.0
"""The driver's timeout: short where a fault swallows the answer, otherwise long enough for a busy machine."""
SILENT = ("hang", "ignore", "cut")
PARTS = {PLAN: (0.0, 0.61), JOINED: (0.58, 0.95)}
"""How much of the exchanges of a measurement has passed when the fault comes."""
KINDS = {
    "hang": {},  # until this attempt is over
    "ignore": {},
    "drop": {},
    "power-cycle": {"seconds": 0.05},
    "meddle": {"message": "POIN 77"},
    "cut": {},
    "garbage": {},
    "wrong-count": {},
}


@dataclass
class Outcome:
    impedance: np.ndarray | None
    error: str
    seconds: float
    struck: bool
    left: list[str]
    """Answers to CONT? and DCO? afterwards."""
    exchanges: int


def bench(sim, **command):
    with socket.create_connection(("127.0.0.1", sim.bench_port), 5) as line:
        line.sendall(json.dumps(command).encode() + b"\n")
        answer = json.loads(line.makefile().readline())
    assert answer["ok"], answer
    return answer


def attempt(sim, kind=None, at=0, plan=PLAN):
    """Measure `plan` with a fault of `kind` at the `at`-th exchange."""
    bench(sim, command="power-cycle", seconds=0.0)
    analyzer = open_analyzer(sim.resource, timeout_seconds=SILENT_SECONDS if kind in SILENT else ANSWER_SECONDS)
    if kind:
        bench(sim, command="fault", kind=kind, at=at, **KINDS[kind])
    before = bench(sim, command="status")["exchanges"]
    begun, impedance, error = time.monotonic(), None, ""
    try:
        impedance = analyzer.measure(plan)[0].impedance
    except InstrumentError as raised:
        error = str(raised)
    finally:
        analyzer.close()
    seconds = time.monotonic() - begun
    status = bench(sim, command="status")
    bench(sim, command="fault", kind="none")
    return Outcome(impedance, error, seconds, bool(status["struck"]), asked(sim), status["exchanges"] - before)


def asked(sim):
    """Answers to CONT? and DCO?, as soon as the instrument answers (after a power failure that takes a moment)."""
    for _ in range(200):
        try:
            with socket.create_connection(("127.0.0.1", sim.port), 5) as line, line.makefile("r") as replies:
                line.sendall(b"CONT?\n")
                continuous = replies.readline().strip()
                line.sendall(b"DCO?\n")
                bias = replies.readline().strip()
        except OSError:
            continuous = bias = ""
        if continuous and bias:
            return [continuous, bias]
        time.sleep(0.01)
    return ["no answer", "no answer"]


def check(outcome, reference, kind, at):
    """Complete and correct, or an error sentence; bias off; in HOLD after an error.

    It is not in HOLD after a power failure, nor if the very first exchange failed, because nothing was changed then.
    An instrument that hangs for ever cannot be set to HOLD; the sentence says so.
    """
    if outcome.impedance is not None:
        np.testing.assert_array_equal(outcome.impedance, reference)
    else:
        assert outcome.error.startswith("TCPIP0::127.0.0.1::")
        assert "\n" not in outcome.error
        assert outcome.left[0] == "0" or kind == "power-cycle" or at == 1 or "Besides: " in outcome.error
    unreachable = kind == "hang" and outcome.error
    assert outcome.left[1] == "0" or unreachable


@pytest.fixture(scope="module")
def sim():
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, noise=False)) as simulator:
        yield simulator


@pytest.fixture(scope="module", params=[PLAN, JOINED], ids=["plain", "list"])
def clean(sim, request):
    return request.param, attempt(sim, plan=request.param)


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("which", range(2))
def test_no_fault_gives_wrong_data(sim, clean, kind, which):
    plan, clean = clean
    part = PARTS[plan][which]
    assert clean.impedance is not None
    at = 1 + int(part * clean.exchanges)
    outcome = attempt(sim, kind, at, plan)
    assert outcome.struck or kind == "wrong-count"  # no block follows the last one
    check(outcome, clean.impedance, kind, at)
