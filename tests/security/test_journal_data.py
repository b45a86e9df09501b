"""No measured data is removed: not at a start without the database, not through a link, not by a copy."""

import json
import logging
import os
import shutil
import sqlite3
import subprocess
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from command_line import run_here

from pzctl import connect
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.integrity.audit import audit_entries
from pzctl.daemon.journal.integrity.repair import repair_folder
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.retention import JournalMaintenance, copy_journal
from pzctl.daemon.journal.store import JournalError
from pzctl.daemon.journal.stores.array_file import find_index, split_array
from pzctl.daemon.journal.withdrawal import withdrawal_event, withdrawal_of
from pzctl.daemon.wire.events import FitEvent, InstrumentInfo, SampleStep, StateEvent, SweepEvent, sweep_columns
from pzctl.daemon.wire.result_messages import FitReport, NoiseReport
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

SWEEP = Sweep(np.linspace(1e6, 2e6, 801), np.exp(1j * np.arange(801)))
INSTRUMENT = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)
REPORT = FitReport("S4", "mason", "1", ("disk",), NoiseReport(1e-3, "repeats"), 1.0, {}, {}, (), 0.1, True, 1, 0.1)


def put_sweep(journal: JournalWriter, build: Build, measurement: str, segment: int = 1, segments: int = 1) -> str:
    columns, payload = sweep_columns(SWEEP)
    event = SweepEvent(
        measurement=measurement,
        sample=SampleStep(build.name, "disk"),
        instrument=INSTRUMENT,
        build=build,
        segment=segment,
        segments=segments,
        started=SWEEP.time,
        settings={"bias_V": 1.0},
        columns=columns,
    )
    return journal.append(event, payload)[0].id


def measure(journal: JournalWriter, build: Build, request: str) -> str:
    measurement, _ = journal.begin_measurement(request, build, "disk")
    sample = SampleStep(build.name, "disk")
    journal.append(StateEvent(state="measuring", measurement=measurement, sample=sample))
    sweep = put_sweep(journal, build, measurement)
    journal.append(StateEvent(state="measured", measurement=measurement, sample=sample))
    columns, payload = sweep_columns(SWEEP)
    fit = FitEvent(
        measurement=measurement,
        sample=sample,
        fitter="mason",
        version="1",
        sweeps=(sweep,),
        report=REPORT,
        columns=columns,
    )
    journal.append(fit, payload)
    return measurement


def arrays_of(folder: Path) -> dict[str, bytes]:
    return {path.name: path.read_bytes() for path in (folder / "arrays").iterdir()}


@pytest.fixture
def folder(tmp_path: Path, build: Build) -> Path:
    """A journal of two measurements, each with a fit."""
    journal = JournalWriter(tmp_path / "journal")
    journal.append(StateEvent(state="started"))
    measure(journal, build, "1")
    measure(journal, build, "2")
    journal.close()
    return tmp_path / "journal"


def pzctl(home: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    return run_here(home, *words)


def remove(path: Path) -> None:
    path.unlink()


def empty(path: Path) -> None:
    path.write_bytes(b"")


def half(path: Path) -> None:
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def rubbish(path: Path) -> None:
    path.write_bytes(b"no database " * 999)


def without_tables(path: Path) -> None:
    path.unlink()
    db = sqlite3.connect(path)
    db.execute("VACUUM")
    db.close()


def without_rows(path: Path) -> None:
    """The database of a new journal, with its tables."""
    other = path.parent.parent / "other"
    JournalWriter(other).close()
    shutil.copy(other / path.name, path)


def scrambled(path: Path) -> None:
    data = bytearray(path.read_bytes())
    data[4096 * 2 :] = b"\xff" * (len(data) - 4096 * 2)
    path.write_bytes(data)


@pytest.mark.parametrize("harm", [remove, empty, half, rubbish, without_tables, without_rows, scrambled])
def test_a_lost_database_stops_the_start_and_nothing_is_removed(folder: Path, harm: Callable[[Path], None]) -> None:
    before = arrays_of(folder)
    harm(folder / "journal.sqlite")
    with pytest.raises(JournalError) as refused:
        JournalWriter(folder)
    assert str(folder) in str(refused.value)
    assert "pzctl journal repair" in str(refused.value)
    assert arrays_of(folder) == before


@pytest.mark.parametrize("harm", [remove, empty, half, rubbish, without_tables, without_rows, scrambled])
def test_repair_writes_the_rows_anew(folder: Path, build: Build, harm: Callable[[Path], None]) -> None:
    reader = JournalReader(folder)
    known, newest = reader.measurements(), reader.newest
    frames = [[*reader.sweeps(one.id), *reader.fits(one.id)] for one in known]
    reader.close()
    before = arrays_of(folder)
    harm(folder / "journal.sqlite")
    harmed = (folder / "journal.sqlite").read_bytes() if (folder / "journal.sqlite").exists() else None
    report = repair_folder(folder)
    assert (report.events, report.measurements, report.set_aside) == (4, 2, [])
    if harmed is not None:
        assert report.kept_database is not None
        assert report.kept_database.read_bytes() == harmed
    journal = JournalWriter(folder)
    assert journal.measurements() == known
    assert [[*journal.sweeps(one.id), *journal.fits(one.id)] for one in known] == frames
    assert [journal.build(one.id) for one in known] == [build, build]
    assert journal.begin_measurement("1", build, "disk") == (known[0].id, False), "a repeated request is known"
    assert journal.verify() == []
    assert journal.append(StateEvent(state="started"))[0].seq > newest, "no number is given twice"
    assert journal.verify() == []
    assert [hole.first for hole in journal.missing(1, newest)] == [1, 4, 6, 8]
    assert arrays_of(folder) == before
    journal.close()


PAGE = 4096


def test_repair_keeps_withdrawals_and_the_audit_log_wherever_the_damage_is(tmp_path: Path, build: Build) -> None:
    """Each page of a database is destroyed in turn; the repair names everything that it cannot keep."""
    whole = tmp_path / "whole"
    journal = JournalWriter(whole)
    journal.append(StateEvent(state="started", client="local"))
    ids = [measure(journal, build, f"request {k}") for k in range(6)]
    refused, _ = journal.begin_measurement("refused", build, "disk")
    journal.append(StateEvent(state="failed", measurement=refused, sample=SampleStep(build.name, "disk"), says="no"))
    journal.append(withdrawal_event(journal, ids[2], "the lead had come off", "bench", "Ana"))
    audit = list(audit_entries(journal.store))
    newest, sweeps = journal.newest, [journal.sweeps(one) for one in ids]
    journal.close()
    kept = names = 0
    pages = range((whole / "journal.sqlite").stat().st_size // PAGE)
    for page in pages:
        folder = tmp_path / str(page)
        shutil.copytree(whole, folder)
        with (folder / "journal.sqlite").open("r+b") as file:
            file.seek(page * PAGE)
            file.write(b"\xff" * PAGE)
        report = repair_folder(folder)
        reader = JournalReader(folder)
        assert reader.verify() == []
        assert [reader.sweeps(one) for one in ids] == sweeps
        assert not [hole for hole in reader.missing(1, newest) if not hole.says]
        withdrawal = withdrawal_of(reader, ids[2])
        measurement = reader.measurement(ids[2])
        assert measurement is not None
        if withdrawal is not None:
            assert (withdrawal.by, withdrawal.why, measurement.state) == ("Ana", "the lead had come off", "withdrawn")
        same = list(audit_entries(reader.store)) == audit
        assert report.lost or (withdrawal and same and reader.measurement(refused))
        kept += bool(withdrawal)
        names += same
        reader.close()
    assert min(kept, names) > len(pages) // 2, "one page of many is damaged: most can be read"


def test_rows_of_another_journal_or_changed_ones_are_not_taken_over(folder: Path, tmp_path: Path, build: Build) -> None:
    """A repair takes only unchanged rows of these recordings from a damaged database."""
    journal = JournalWriter(folder)
    first, second = (one.id for one in journal.measurements())
    journal.append(withdrawal_event(journal, first, "the lead had come off", "bench", "Ana"))
    journal.close()
    with closing(sqlite3.connect(folder / "journal.sqlite")) as db, db:
        (header,) = db.execute("SELECT header FROM events WHERE kind = 'state' ORDER BY seq DESC").fetchone()
        forged = header.replace(first.encode(), second.encode())
        db.execute("UPDATE events SET header = ?, measurement = ? WHERE header = ?", (forged, second, header))
        db.execute("UPDATE measurements SET state = 'withdrawn' WHERE id = ?", (second,))
        db.execute("PRAGMA writable_schema=ON")
        db.execute("UPDATE sqlite_schema SET rootpage = 99999 WHERE name = 'fits'")
    report = repair_folder(folder)
    assert [sentence for sentence in report.lost if "not what was written" in sentence]
    with closing(JournalReader(folder)) as reader:
        assert [one.state for one in reader.measurements()] == ["withdrawn", "measured"]
    other = JournalWriter(tmp_path / "other")
    other.append(StateEvent(state="leased", client="somebody"))
    other.close()
    shutil.copy(tmp_path / "other" / "journal.sqlite", folder / "journal.sqlite")
    report = repair_folder(folder)
    assert (report.salvaged, [one for one in report.lost if "names one of the recordings" in one] != []) == (0, True)


def test_an_older_copy_of_the_database_is_completed(tmp_path: Path, build: Build) -> None:
    folder = tmp_path / "journal"
    journal = JournalWriter(folder)
    first = measure(journal, build, "1")
    journal.close()
    shutil.copy(folder / "journal.sqlite", tmp_path / "older.sqlite")
    journal = JournalWriter(folder)
    second = measure(journal, build, "2")
    journal.close()
    shutil.copy(tmp_path / "older.sqlite", folder / "journal.sqlite")
    before = arrays_of(folder)
    with pytest.raises(JournalError, match=r"older than they are; nothing was changed.*pzctl journal repair"):
        JournalWriter(folder)
    assert arrays_of(folder) == before
    assert repair_folder(folder).measurements == 1
    journal = JournalWriter(folder)
    assert [(one.id, one.state) for one in journal.measurements()] == [(first, "measured"), (second, "measured")]
    assert len(journal.fits(second)) == 1
    assert journal.verify() == []
    journal.close()


def test_an_array_of_an_earlier_version_is_read_without_guessing(folder: Path) -> None:
    reader = JournalReader(folder)
    first = reader.measurements()[0].id
    sweep = reader.sweep_ids(first)[0]
    (lengths,) = reader.store.all("SELECT lengths FROM events WHERE id = ?", sweep)[0]
    path = folder / "arrays" / f"{sweep}.bin"
    columns = split_array(path.read_bytes(), lengths).columns
    path.write_bytes(columns)
    assert len(reader.sweeps(first)) == 1
    assert reader.verify() == []
    reader.close()
    (folder / "journal.sqlite").unlink()
    report = repair_folder(folder)
    assert report.set_aside == [f"{sweep}.bin: it has no index: an earlier pzctl wrote it, or its end is damaged"]
    assert (folder / "orphans" / f"{sweep}.bin").read_bytes() == columns
    JournalWriter(folder).close()


def test_arrays_that_cannot_be_indexed_are_left_where_they_are(tmp_path: Path) -> None:
    arrays = tmp_path / "journal" / "arrays"
    arrays.mkdir(parents=True)
    (arrays / "old.bin").write_bytes(b"1234")
    with pytest.raises(JournalError, match=r"none of the 1 recording\(s\) in arrays/ has a valid index; nothing was"):
        repair_folder(tmp_path / "journal")
    assert (arrays / "old.bin").read_bytes() == b"1234"


def test_an_array_starts_with_raw_columns_and_ends_with_its_index(folder: Path) -> None:
    """Programs that read the columns from byte 0 are not affected by the index."""
    reader = JournalReader(folder)
    measurement = reader.measurements()[0]
    (frames,) = reader.sweeps(measurement.id)
    data = (folder / "arrays" / f"{reader.sweep_ids(measurement.id)[0]}.bin").read_bytes()
    assert np.array_equal(np.frombuffer(data, "<f8", 801), SWEEP.frequency)
    assert data.startswith(b"".join(frames[2:]))
    index = find_index(data)
    assert index is not None
    assert index.measurement is not None
    assert (index.header.encode(), index.measurement.id) == (frames[1], measurement.id)
    reader.close()


def test_orphans_are_set_aside_and_said_once(folder: Path, caplog: pytest.LogCaptureFixture) -> None:
    (folder / "arrays" / "0-whole.bin").write_bytes(b"abc")
    (folder / "arrays" / "0-half.part").write_bytes(b"ab")
    with caplog.at_level(logging.WARNING):
        JournalWriter(folder).close()
        JournalWriter(folder).close()
    assert (folder / "orphans" / "0-whole.bin").read_bytes() == b"abc"
    assert (folder / "orphans" / "0-half.part").read_bytes() == b"ab"
    assert [record.getMessage().count("nothing was removed") for record in caplog.records] == [1]


@pytest.mark.skipif(os.name != "posix", reason="links need a right of their own on Windows")
def test_no_link_leads_out_of_the_folder(folder: Path, tmp_path: Path) -> None:
    outside = tmp_path / "outside"
    outside.mkdir()
    (outside / "precious.bin").write_bytes(b"precious")
    (folder / "arrays" / "link.bin").symlink_to(outside / "precious.bin")
    JournalWriter(folder).close()
    assert (outside / "precious.bin").read_bytes() == b"precious"
    assert (folder / "orphans" / "link.bin").is_symlink()
    (folder / "arrays").rename(tmp_path / "aside")
    (folder / "arrays").symlink_to(outside)
    with pytest.raises(JournalError, match="arrays: this is a symbolic link, which a journal does not follow"):
        JournalWriter(folder)
    assert [path.name for path in outside.iterdir()] == ["precious.bin"]


def test_a_backup_shares_no_inode(folder: Path, tmp_path: Path) -> None:
    reader = JournalReader(folder)
    copy_journal(reader, tmp_path / "copy")
    reader.close()
    for path in (folder / "arrays").iterdir():
        copy = tmp_path / "copy" / "arrays" / path.name
        assert copy.stat().st_ino != path.stat().st_ino
        assert path.stat().st_nlink == copy.stat().st_nlink == 1
        data = bytearray(path.read_bytes())
        data[5] ^= 1
        with path.open("r+b") as file:
            file.write(data)
    original, copy = JournalReader(folder), JournalReader(tmp_path / "copy")
    assert (len(original.verify()), copy.verify()) == (4, [])
    original.close()
    copy.close()


def test_a_pruned_journal_is_repaired_and_a_backup_as_well(folder: Path, tmp_path: Path, build: Build) -> None:
    keeper = JournalMaintenance(folder)
    assert keeper.prune("2999-01-01", tmp_path / "backup") == 9
    measure(keeper, build, "3")
    keeper.close()
    for place in (folder, tmp_path / "backup"):
        (place / "journal.sqlite").unlink()
        repair_folder(place)
        reader = JournalReader(place)
        assert reader.verify() == []
        assert len(reader.measurements()) == (1 if place == folder else 2)
        reader.close()


def test_the_remains_of_a_kill_do_not_prevent_a_start(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """An array is written before its row: after a kill in between, it is set aside and its number is used again."""
    journal = JournalWriter(folder)
    written = journal.store.write_array

    def write_and_die(event: str, data: bytes) -> None:
        written(event, data)
        raise KeyboardInterrupt

    monkeypatch.setattr(journal.store, "write_array", write_and_die)
    with pytest.raises(KeyboardInterrupt):
        put_sweep(journal, journal.build(journal.measurements()[0].id), "m")
    journal.close()
    again = JournalWriter(folder)
    assert (len(list((folder / "orphans").iterdir())), again.last_seq, again.verify()) == (1, 9, [])
    again.close()


def test_a_reader_is_told_too(folder: Path) -> None:
    (folder / "journal.sqlite").unlink()
    told = pzctl(folder.parent, "samples")
    assert (told.returncode, "pzctl journal repair" in " ".join(told.stderr.split())) == (1, True), told


def test_the_daemon_says_so_and_the_command_repairs(start_daemon, build: Build, tmp_path: Path) -> None:
    start_daemon("Echo")
    with connect() as lab:
        measurement = lab.measure(build, "disk").id
        lab.shutdown()
    JournalMaintenance(journal_folder(tmp_path)).close()  # waits for the daemon to end
    (journal_folder(tmp_path) / "journal.sqlite").unlink()
    told = pzctl(tmp_path, "daemon")
    assert (told.returncode, "run `pzctl journal repair`" in " ".join(told.stderr.split())) == (1, True), told
    done = json.loads(pzctl(tmp_path, "journal", "repair", "--json").stdout)
    assert (done["measurements"], done["set_aside"]) == (1, [])
    assert "all intact" in pzctl(tmp_path, "journal", "verify").stdout
    start_daemon("Echo")
    with connect() as lab:
        assert [one.measurement for one in lab.samples()[0].measurements] == [measurement]
