"""A withdrawn measurement is marked for everybody, counts only on request, and is never removed."""

import json
import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from command_line import run_here
from guest_examples import Echo
from keyed import asked

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import home, journal_folder, keys_folder
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.withdrawal import WithdrawalError, withdrawal_event
from pzctl.daemon.report.document.report_sections import measured
from pzctl.daemon.samples.sample_record import sample_record
from pzctl.daemon.samples.sample_selection import journal_samples
from pzctl.daemon.server.workers.fitter_worker import FitterWorker
from pzctl.daemon.wire.curve_keys import make_client, make_server
from pzctl.daemon.wire.events import InstrumentInfo, SampleStep, StateEvent, SweepEvent, sweep_columns
from pzctl.fitters.interface import FitResult, FitTask
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

PZCTL = Path(sys.executable).with_name("pzctl")
WITHDRAW = ("--by", "Ana", "--why", "the lead had come off")


def pzctl(*words: str) -> tuple[int, str]:
    ran = run_here(Path(os.environ["PZCTL_HOME"]), *words)
    return ran.returncode, ran.stdout + ran.stderr


def put(journal: JournalWriter, build: Build, ohm: float) -> str:
    """Put a complete measurement of the bare disk into the journal, as the daemon does."""
    measurement, _ = journal.begin_measurement(f"{ohm:g}", build, "disk")
    of = SampleStep(build.name, "disk")
    columns, payload = sweep_columns(Sweep(np.linspace(1e6, 6e6, 51), np.full(51, ohm + 0j)))
    info = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)
    said = {"instrument": info, "build": build, "segment": 1, "segments": 1, "started": "", "settings": {}}
    journal.append(SweepEvent(measurement=measurement, sample=of, columns=columns, **said), payload)
    journal.append(StateEvent(state="measured", measurement=measurement, sample=of))
    return measurement


@pytest.fixture
def two(tmp_path: Path, build: Build, monkeypatch: pytest.MonkeyPatch) -> tuple[str, str]:
    """A sample's step, measured twice."""
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    journal = JournalWriter(tmp_path / "journal")
    made = put(journal, build, 50.0), put(journal, build, 70.0)
    journal.close()
    return made


def used(*, with_withdrawn: bool = False) -> str | None:
    """Return the measurement that fits and populations use."""
    journal = JournalReader(journal_folder(home()))
    try:
        (sample,) = journal_samples(journal, with_withdrawn=with_withdrawn)
        return sample.measurement
    finally:
        journal.close()


def test_it_counts_no_more_unless_asked_and_nothing_of_it_is_removed(two: tuple[str, str]) -> None:
    first, second = two
    assert used() == second
    assert pzctl("journal", "withdraw", second, *WITHDRAW)[0] == 0
    assert (used(), used(with_withdrawn=True)) == (first, second)
    journal = JournalReader(journal_folder(home()))
    assert len(journal.sweeps(second)) == 1, "its recording is there"
    assert journal.latest("S4.a", "disk", "") is None
    assert journal.verify() == []
    journal.close()


def test_everybody_sees_who_withdrew_it_and_why(two: tuple[str, str]) -> None:
    first, second = two
    pzctl("journal", "withdraw", second, *WITHDRAW)
    (sample,) = json.loads(pzctl("samples", "--json")[1])["samples"]
    told = {one["id"]: (one["state"], one["withdrawn"]) for one in sample["measurements"]}
    assert told[first] == ("measured", None)
    assert told[second][0] == "withdrawn"
    assert (told[second][1]["by"], told[second][1]["why"]) == ("Ana", "the lead had come off")
    for words in (("samples",), ("show", "S4.a"), ("show", second), ("journal", "audit")):
        assert "Ana" in pzctl(*words)[1], words
    assert json.loads(pzctl("show", "S4.a", "--json")[1])["steps"][0]["measurement"] == first
    journal = JournalReader(journal_folder(home()))
    for asked_for in ("S4.a", second):
        assert "withdrawn by Ana" in measured(sample_record(journal, asked_for)), "in the report"
    journal.close()


def test_a_sample_of_which_nothing_counts_says_so(two: tuple[str, str]) -> None:
    for one in two:
        pzctl("journal", "withdraw", one, *WITHDRAW)
    code, told = pzctl("show", "S4.a")
    assert (code, "all its measurements were withdrawn" in told, "the lead had come off" in told) == (2, True, True)


def test_what_cannot_be_withdrawn_is_a_sentence(two: tuple[str, str]) -> None:
    assert "holds no measurement 'nothing'" in pzctl("journal", "withdraw", "nothing", *WITHDRAW)[1]
    pzctl("journal", "withdraw", two[0], *WITHDRAW)
    assert "is withdrawn; only a measured one" in pzctl("journal", "withdraw", two[0], *WITHDRAW)[1]
    assert "--why is empty" in pzctl("journal", "withdraw", two[1], "--by", "Ana", "--why", " ")[1]


def test_a_station_withdraws_only_what_it_measured(tmp_path: Path, build: Build) -> None:
    journal = JournalWriter(tmp_path, station="bench1")
    one = put(journal, build, 50.0)
    journal.close()
    other = JournalReader(tmp_path, "bench2")
    with pytest.raises(WithdrawalError, match="belongs to station 'bench1'"):
        withdrawal_event(other, one, "why", "local", "Ana")
    other.close()


def test_a_running_daemon_does_it_and_nobody_with_another_key(
    two: tuple[str, str], start_daemon: Callable[..., Location], end: Callable[..., None]
) -> None:
    make_server(keys_folder(home()))
    boss = make_client(keys_folder(home()), "boss", "admin")
    where = start_daemon()
    request = {"request": "withdraw", "id": "1", "measurement": two[1], "why": "because", "by": "boss"}
    refused = asked(where, boss, request)["error"]
    assert refused["code"] == "not-allowed"
    assert used() == two[1]
    with connect() as lab:
        heard = lab.listen(60.0)
        code, told = pzctl("journal", "withdraw", two[1], *WITHDRAW)
        assert code == 0, told
        events = (one.event for one in heard)
        event = next(one for one in events if isinstance(one, StateEvent) and one.state == "withdrawn")
        assert (event.measurement, event.by, event.client, event.says) == (two[1], "Ana", "local", WITHDRAW[3])
        with pytest.raises(DaemonError, match="was withdrawn"):
            lab.fit(two[1], "mason")
        with pytest.raises(DaemonError, match="was withdrawn"):
            lab.diagnose(two[0], also=[two[1]])
    end(where.pid, signal.SIGTERM)
    assert used() == two[0]


def test_a_fit_of_what_is_withdrawn_meanwhile_does_not_end_its_fitter(
    start_daemon: Callable[..., Location], build: Build
) -> None:
    """Nobody waits for the answer, and a new process would have to load everything again."""
    start_daemon()
    with connect() as lab:
        measurement = lab.measure(build, "disk").id

        class Late(Echo):
            def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
                assert pzctl("journal", "withdraw", measurement, *WITHDRAW)[0] == 0
                return super().fit(task, progress)

        FitterWorker("echo", Late(), lab).answer(measurement)
        assert lab.fits(measurement) == ()
