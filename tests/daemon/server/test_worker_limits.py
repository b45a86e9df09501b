"""The daemon ends a fitter worker that hangs, leaks or floods its log, and answers for it; measuring goes on."""

import time
from pathlib import Path

import pytest

from pzctl.daemon.client.client import connect
from pzctl.daemon.files.worker_limits import Limits
from pzctl.daemon.server.workers.pending_results import PendingResults
from pzctl.daemon.server.workers.supervisor import QUIET
from pzctl.daemon.wire.events import FitEvent, SampleStep, StateEvent
from pzctl.fitters.interface import FitError
from pzctl.models.build import Build

ECHO = "guest_examples:Echo"


@pytest.mark.parametrize(
    ("fitter", "limits", "says"),
    [
        ("Hangs", Limits(seconds=1.0), r"crashed 2 times over this measurement: gave no answer within 1 s"),
        ("Leaks", Limits(memory_MB=1000), r"crashed 2 times .* needs more than the allowed 1000 MB"),
        ("Chatters", Limits(), r"failed: OSError: .*File too large"),
    ],
)
def test_a_bad_guest_is_answered_for(
    start_daemon, build: Build, fitter: str, limits: Limits, says: str, tmp_path: Path
) -> None:
    start_daemon(fitter, "Echo", limits=limits)
    with connect() as lab:
        measurement = lab.measure(build, "disk").id
        assert lab.wait_fit(ECHO, measurement).steps == ("disk",), "the good one beside it is not disturbed"
        with pytest.raises(FitError, match=says):
            lab.wait_fit(f"guest_examples:{fitter}", measurement)
        assert lab.measure(build, "ml1").sweeps
    assert sum(path.stat().st_size for path in (tmp_path / "log").iterdir()) < 70 << 20


def test_pending_results_list_the_fitter_and_the_start_time() -> None:
    now = 0.0
    ledger = PendingResults(["a", "b"], lambda: now)
    for moment, measurement in ((1.0, "m1"), (2.0, "m2")):
        now = moment
        ledger.note(StateEvent(state="measured", measurement=measurement))
    now = 5.0
    assert (ledger.first("a"), ledger.waited("a", began=0.0), ledger.waited("a", began=4.0)) == ("m1", 4.0, 1.0)
    sample = SampleStep("s", "disk")
    ledger.note(FitEvent(measurement="m1", sample=sample, fitter="a", version="1", sweeps=()))
    now = 6.0
    assert (ledger.first("a"), ledger.waited("a", began=0.0)) == ("m2", 1.0)
    assert (ledger.first("b"), ledger.waited("b", began=0.0)) == ("m1", 5.0)
    assert (ledger.first("stranger"), ledger.waited("stranger", 0.0)) == (None, 0.0)
    ledger.note(StateEvent(state="withdrawn", measurement="m2"))
    assert ledger.first("a") is None, "it takes no answers any more"
    assert ledger.first("b") == "m1"


def test_a_repeated_hello_is_published_once(start_daemon) -> None:
    start_daemon()
    with connect() as lab:
        before = lab.hello("me", "1").seq
        for _ in range(50):
            lab.hello("me", "1")
        assert lab.hello("me", "1").seq == before
        time.sleep(QUIET)
        assert lab.hello("me", "2").seq == before + 1
