"""The journal: every announced event is on disk, complete, once, in order, and only one daemon writes it."""

import sqlite3
import subprocess
import sys
import time
import uuid
from collections.abc import Callable, Iterator
from contextlib import nullcontext
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pzctl.daemon.files.paths import FolderError
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.store import JournalError
from pzctl.daemon.journal.stores.folder_lock import is_written
from pzctl.daemon.samples.sample_selection import open_journal
from pzctl.daemon.server.launch import start
from pzctl.daemon.wire.events import FitEvent, InstrumentInfo, SampleStep, StateEvent, SweepEvent, decode, sweep_columns
from pzctl.daemon.wire.result_messages import FitReport, NoiseReport
from pzctl.daemon.wire.uuid7 import uuid7
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

SWEEP = Sweep(np.linspace(1e6, 2e6, 801), np.exp(1j * np.arange(801)))
INSTRUMENT = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)


@pytest.fixture
def journal(tmp_path: Path) -> Iterator[JournalWriter]:
    opened = JournalWriter(tmp_path / "journal")
    yield opened
    opened.close()


def put_sweep(journal: JournalWriter, build: Build, measurement: str, step: str = "disk") -> SweepEvent:
    columns, payload = sweep_columns(SWEEP)
    event = SweepEvent(
        measurement=measurement,
        sample=SampleStep(build.name, step),
        instrument=INSTRUMENT,
        build=build,
        segment=1,
        segments=1,
        started=SWEEP.time,
        settings={},
        columns=columns,
    )
    return journal.append(event, payload)[0]


def measured(journal: JournalWriter, build: Build, request: str, step: str = "disk") -> str:
    measurement, _ = journal.begin_measurement(request, build, step)
    put_sweep(journal, build, measurement, step)
    journal.append(StateEvent(state="measured", measurement=measurement, sample=SampleStep(build.name, step)))
    return measurement


def fit_event(measurement: str, sweep: str, *, ok: bool = True) -> FitEvent:
    report = FitReport("S4", "mason", "1", ("disk",), NoiseReport(1e-3, "repeats"), 1.0, {}, {}, (), 0.1, True, 1, 0.1)
    answer = {"report": report} if ok else {"error": "no resonance"}
    sample = SampleStep("S4.a", "disk")
    return FitEvent(measurement=measurement, sample=sample, fitter="mason", version="1", sweeps=(sweep,), **answer)


def test_events_are_read_as_they_were_written(journal: JournalWriter, build: Build) -> None:
    _, said = journal.append(StateEvent(state="started"))
    assert journal.replay(1, None, 50) == [said]
    event = put_sweep(journal, build, "m")
    (again,) = journal.replay(event.seq, event.seq, 50)
    heard = decode(again)
    assert heard.event == event
    assert np.array_equal(heard.sweep().impedance, SWEEP.impedance)


def test_a_new_run_continues_the_numbering(journal: JournalWriter, tmp_path: Path) -> None:
    first = journal.append(StateEvent(state="started"))[0]
    journal.close()
    later = JournalWriter(tmp_path / "journal")
    second = later.append(StateEvent(state="started"))[0]
    later.close()
    assert (first.seq, second.seq) == (1, 2)
    assert first.run != second.run


def test_one_writes_and_many_read(journal: JournalWriter, tmp_path: Path) -> None:
    with pytest.raises(JournalError, match="another daemon writes this journal"):
        JournalWriter(tmp_path / "journal")
    reader = JournalReader(tmp_path / "journal")
    journal.append(StateEvent(state="started"))
    assert len(reader.replay(1, None, 50)) == 1
    assert is_written(tmp_path / "journal")
    with pytest.raises(JournalError, match="readonly"):
        reader._all("DELETE FROM events")
    reader.close()
    journal.close()
    assert not is_written(tmp_path / "journal")


@pytest.mark.parametrize("open_again", [JournalWriter.reader, lambda _: open_journal()], ids=["daemon", "page"])
def test_reading_in_the_same_process_keeps_the_lock_of_the_database(
    open_again: Callable[[JournalWriter], JournalReader],
    journal: JournalWriter,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """Another program that closes the database would remove its log, with all that is written from then on."""
    count = "import sqlite3, sys; db = sqlite3.connect(sys.argv[1]); "
    count += "print(db.execute('SELECT count(*) FROM events').fetchone()[0]); db.close()"
    another = [sys.executable, "-c", count, tmp_path / "journal" / "journal.sqlite"]
    journal.append(StateEvent(state="one"))
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    open_again(journal).close()
    seen = [subprocess.check_output(another, text=True).strip()]
    journal.append(StateEvent(state="two"))
    seen.append(subprocess.check_output(another, text=True).strip())
    assert seen == ["1", "2"]


def test_the_remains_of_an_interrupted_write_are_removed(journal: JournalWriter, build: Build, tmp_path: Path) -> None:
    kept = put_sweep(journal, build, "m")
    journal.close()
    arrays = tmp_path / "journal" / "arrays"
    (arrays / "0-half.part").write_bytes(b"abc")
    (arrays / "0-whole.bin").write_bytes(b"abc")
    again = JournalWriter(tmp_path / "journal")
    assert [path.stem for path in arrays.iterdir()] == [kept.id]
    assert again.verify() == []
    again.close()


def test_damage_is_found(journal: JournalWriter, build: Build, tmp_path: Path) -> None:
    one, other = put_sweep(journal, build, "m"), put_sweep(journal, build, "m")
    path = tmp_path / "journal" / "arrays" / f"{one.id}.bin"
    path.write_bytes(b"\x01" + path.read_bytes()[1:])
    (tmp_path / "journal" / "arrays" / f"{other.id}.bin").unlink()
    assert [line[:8] for line in journal.verify()] == ["event 1:", "event 2:"]
    with pytest.raises(JournalError, match="is damaged"):
        journal.sweeps("m")


def test_what_cannot_be_written_is_not_counted(journal: JournalWriter, build: Build, tmp_path: Path) -> None:
    (tmp_path / "journal" / "arrays").rmdir()
    with pytest.raises(JournalError, match="the journal cannot be read or written"):
        put_sweep(journal, build, "m")
    assert journal.last_seq == 0
    assert journal.append(StateEvent(state="started"))[0].seq == 1


def test_a_journal_of_a_later_version_is_not_changed(journal: JournalWriter, tmp_path: Path) -> None:
    journal.close()
    db = sqlite3.connect(tmp_path / "journal" / "journal.sqlite")
    db.execute("PRAGMA user_version = 9")
    db.close()
    with pytest.raises(JournalError, match="a journal of version 9; this pzctl reads version 4"):
        JournalWriter(tmp_path / "journal")


def test_a_repeated_request_is_measured_once(journal: JournalWriter, build: Build) -> None:
    first, new = journal.begin_measurement("r", build, "disk")
    assert (first, new) == (first, True)
    assert journal.begin_measurement("r", build, "disk") == (first, False)
    assert journal.build(first) == build
    assert [found.state for found in journal.measurements()] == ["queued"]


def test_a_fit_counts_once_and_replaces_a_refusal(journal: JournalWriter, build: Build) -> None:
    measurement = measured(journal, build, "a")
    sweep = journal.sweep_ids(measurement)[0]
    assert journal.unanswered("mason") == [measurement]
    refusal, result = fit_event(measurement, sweep, ok=False), fit_event(measurement, sweep)
    seq = journal.append(refusal)[0].seq
    assert journal.answered(refusal) == seq
    assert journal.answered(result) is None
    assert journal.fitters(measurement) == ()
    journal.append(result)
    assert journal.answered(result) == journal.answered(refusal) == seq + 1
    assert journal.fitters(measurement) == ("mason",)
    assert journal.unanswered("mason") == []


def test_the_latest_complete_measurement_of_an_earlier_step(journal: JournalWriter, build: Build) -> None:
    measured(journal, build, "a")
    second = measured(journal, build, "b")
    ml1 = measured(journal, build, "c", "ml1")
    journal.begin_measurement("d", build, "disk")
    measured(journal, build, "e")
    assert journal.latest(build.name, "disk", before=ml1) == second
    assert journal.latest("another", "disk", before=ml1) is None


def test_ids_are_of_version_7_and_sort_by_time() -> None:
    ids: list[str] = []
    for _ in range(20):
        ids.append(uuid7())
        time.sleep(0.002)
    assert ids == sorted(ids)
    assert {(uuid.UUID(one).version, uuid.UUID(one).variant) for one in ids} == {(7, uuid.RFC_4122)}
    assert abs((uuid.UUID(ids[-1]).int >> 80) / 1000 - time.time()) < 60


def test_a_full_disk_takes_no_measurement(
    journal: JournalWriter, build: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    known, _ = journal.begin_measurement("before", build, "disk")
    monkeypatch.setattr("shutil.disk_usage", lambda _: SimpleNamespace(free=3 << 20))
    with pytest.raises(JournalError, match="3 MB are free on its disk; 64 MB are needed"):
        journal.begin_measurement("new", build, "disk")
    assert journal.begin_measurement("before", build, "disk") == (known, False)
    assert [one.id for one in journal.measurements()] == [known]


def test_ids_stay_in_order_when_the_clock_is_set_back(
    journal: JournalWriter, build: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    first = measured(journal, build, "1")
    now = time.time_ns
    monkeypatch.setattr("time.time_ns", lambda: now() - 86_400_000_000_000)
    second = measured(journal, build, "2")
    assert second < first, "ids go back with the clock"
    later, _ = journal.begin_measurement("3", build, "ml1")
    assert [one.id for one in journal.measurements()] == [first, second, later]
    assert journal.latest(build.name, "disk", later) == second
    assert [decode(frames).event.seq for frames in journal.replay(1, None, 50)] == [1, 2, 3, 4]
    assert journal.verify() == []


def test_on_a_full_disk_the_journal_can_be_read_but_no_daemon_starts(
    journal: JournalWriter, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    resource = pytest.importorskip("resource", reason="no limit for the size of files")
    measurement = measured(journal, build, "1")
    journal.close()
    log = tmp_path / "journal" / "journal.sqlite-wal"
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    for left, there in ((b"", True), (b"something that is to be read " * 9, False)):
        log.write_bytes(left)
        resource.setrlimit(resource.RLIMIT_FSIZE, (0, before[1]))  # no file can grow
        try:
            assert not is_written(tmp_path / "journal")
            with pytest.raises(FolderError, match="cannot be written: File too large"):
                start()
            with nullcontext() if there else pytest.raises(JournalError, match="cannot be read or written"):
                reader = JournalReader(tmp_path / "journal")
                assert len(reader.sweeps(measurement)) == 1
                reader.close()
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.skipif(sys.platform != "linux", reason="/sys and /proc are folders of Linux")
@pytest.mark.parametrize(("folder", "says"), [("/sys", "cannot be written"), ("/proc/no/such", "cannot be made")])
def test_a_data_folder_that_is_of_no_use_is_said(folder: str, says: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", folder)
    with pytest.raises(FolderError, match=f"the data folder {folder} {says}: .*; set PZCTL_HOME to"):
        start()
