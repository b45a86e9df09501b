"""What happened to a journal's files must not cost a recording: nothing is removed, and rows come back from arrays."""

import os
import sqlite3
from collections.abc import Callable
from pathlib import Path

import pytest

from pzctl.daemon.client.client import connect
from pzctl.daemon.journal.folder_lock import is_written
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.repair import repair
from pzctl.daemon.journal.retention import copy_journal
from pzctl.daemon.journal.store import JournalError
from pzctl.models.build import Build

Recorded = tuple[Path, str, bytes]


@pytest.fixture
def recorded(
    tmp_path: Path,
    start_daemon: Callable[..., object],
    build: Build,
    wait_until: Callable[[Callable[[], object]], None],
) -> Recorded:
    """Return a journal that a daemon left, the id of its one measurement, and the bytes of its first sweep."""
    start_daemon()
    with connect() as lab:
        done = lab.measure(build, "disk")
        lab.shutdown()
    wait_until(lambda: not is_written(tmp_path / "journal"))
    return tmp_path / "journal", done.id, done.sweeps[0].impedance.tobytes()


def closed(folder: Path) -> None:
    JournalWriter(folder).close()


@pytest.mark.parametrize("loss", ["missing", "empty", "new"])
def test_a_lost_database_stops_the_start_and_costs_no_recording(recorded: Recorded, loss: str) -> None:
    folder, measurement, impedance = recorded
    arrays = {path: path.read_bytes() for path in (folder / "arrays").iterdir()}
    for path in folder.glob("journal.sqlite*"):
        path.unlink()
    if loss != "missing":
        (folder / "journal.sqlite").touch()
    if loss == "new":
        with sqlite3.connect(folder / "journal.sqlite") as db:
            db.execute("CREATE TABLE other (x)")
    with pytest.raises(JournalError, match="pzctl journal repair"):
        JournalWriter(folder)
    assert {path: path.read_bytes() for path in (folder / "arrays").iterdir()} == arrays
    if loss == "new":
        (folder / "journal.sqlite").unlink()
    done = repair(folder)
    assert (done.recordings, done.silent) == (len(arrays), ())
    journal = JournalReader(folder)
    assert [one.id for one in journal.measurements()] == [measurement]
    assert impedance in b"".join(journal.sweeps(measurement)[0])
    assert not [line for line in journal.verify() if "missing: the next" not in line]
    journal.close()
    closed(folder)


def test_a_damaged_database_is_kept_and_rebuilt(recorded: Recorded) -> None:
    folder, measurement, _ = recorded
    path = folder / "journal.sqlite"
    content = bytearray(path.read_bytes())
    for page in range(4096, len(content), 4096):
        content[page : page + 64] = os.urandom(64)
    path.write_bytes(content)
    journal = JournalReader(folder)
    with pytest.raises(JournalError, match="malformed"):
        journal.verify()
    journal.close()
    done = repair(folder)
    assert done.aside is not None
    assert done.aside.read_bytes() == content
    journal = JournalReader(folder)
    assert [one.id for one in journal.measurements()] == [measurement]
    journal.close()


def test_an_older_copy_of_the_database_sets_later_recordings_aside_and_repair_brings_them_back(
    recorded: Recorded,
) -> None:
    folder, measurement, _ = recorded
    with sqlite3.connect(folder / "journal.sqlite") as db:  # as a copy from before the measurement has it
        db.execute("PRAGMA foreign_keys=OFF")
        for table in ("fits", "events", "measurements"):
            db.execute(f"DELETE FROM {table}")  # noqa: S608
    names = {path.name for path in (folder / "arrays").iterdir()}
    writer = JournalWriter(folder)
    assert set(writer.set_aside) == names
    writer.close()
    assert {path.name for path in (folder / "orphans").iterdir()} == names
    assert repair(folder).recordings == len(names)
    journal = JournalReader(folder)
    assert len(journal.sweeps(measurement)) == len(names)
    journal.close()


def test_files_behind_a_link_stay_where_they_are(recorded: Recorded, tmp_path: Path) -> None:
    folder, _, _ = recorded
    elsewhere = tmp_path / "elsewhere"
    (folder / "arrays").rename(elsewhere)
    (folder / "arrays").symlink_to(elsewhere)
    (elsewhere / "of-another-program.bin").write_bytes(b"abc")
    writer = JournalWriter(folder)
    assert writer.set_aside == ["of-another-program.bin"]
    writer.close()
    assert (elsewhere / "of-another-program.bin").read_bytes() == b"abc"


def test_recordings_of_earlier_versions_are_said_and_kept(recorded: Recorded) -> None:
    folder, _, _ = recorded
    old = folder / "arrays" / "01890000-0000-7000-8000-000000000000.bin"
    old.write_bytes(b"columns alone")
    assert repair(folder).silent == (old,)
    assert old.exists()


def test_a_copy_shares_nothing_with_what_it_was_copied_from(recorded: Recorded, tmp_path: Path) -> None:
    folder, measurement, _ = recorded
    source = JournalReader(folder)
    copy_journal(source, tmp_path / "copy")
    for path in (folder / "arrays").iterdir():
        path.write_bytes(b"\xff" + path.read_bytes()[1:])
    assert source.verify()
    source.close()
    copy = JournalReader(tmp_path / "copy")
    assert copy.verify() == []
    assert copy.sweeps(measurement)
    copy.close()
