"""A journal is checked, copied, pruned and upgraded without losing data that it should keep."""

import json
import shutil
import sqlite3
import subprocess
from pathlib import Path

import pytest
from command_line import run_here

from pzctl import connect
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.retention import COLUMNS, JournalMaintenance, copy_journal
from pzctl.daemon.journal.store import JournalError
from pzctl.daemon.journal.stores.migrations import _STEPS
from pzctl.daemon.wire.events import SampleStep, StateEvent
from pzctl.daemon.wire.replies import MissingEvents
from pzctl.models.build import Build


def pzctl(home: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    return run_here(home, *words)


def test_checked_and_copied_while_the_daemon_runs_then_pruned(start_daemon, build: Build, tmp_path: Path) -> None:
    start_daemon("Echo")
    with connect() as lab:
        lab.wait_fit("guest_examples:Echo", lab.measure(build, "disk").id)
        told = json.loads(pzctl(tmp_path, "status", "--json").stdout)
        assert told["metrics"]["counts"]["sweep"] == 2
        assert told["metrics"]["seconds"]["publish"]["median"] > 0
        assert "2 sweeps, 1 fits" in pzctl(tmp_path, "status").stdout
        assert "all intact" in pzctl(tmp_path, "journal", "verify").stdout
        assert "and verified" in pzctl(tmp_path, "journal", "backup", str(tmp_path / "copy")).stdout
        refused = pzctl(tmp_path, "journal", "prune", "--before", "2999-01-01", "--backup", str(tmp_path / "all"))
        assert "another daemon writes this journal" in refused.stderr
        lab.shutdown()
        newest = JournalReader(journal_folder(tmp_path)).newest
    words = ("journal", "prune", "--before", "2999-01-01", "--backup", str(tmp_path / "all"))
    done = pzctl(tmp_path, *words, "--json")
    assert json.loads(done.stdout)["removed"] > 0, done.stderr
    archive = JournalReader(journal_folder(tmp_path))
    assert archive.measurements() == []
    assert archive.verify() == []
    assert archive.newest >= newest
    assert not list((journal_folder(tmp_path) / "arrays").iterdir())
    archive.close()
    kept = JournalReader(tmp_path / "all")
    assert (len(kept.measurements()), kept.verify()) == (1, [])
    kept.close()
    start_daemon()
    with connect() as lab:
        measured = lab.measure(build, "disk")
        holes: list[MissingEvents] = []
        heard = list(lab.replay(1, missing=holes.append))
        assert [(hole.first, hole.last + 1) for hole in holes] == [(1, heard[0].event.seq)]
        assert heard[0].event.seq > newest, "numbers go on"
        assert [one.event.seq for one in heard] == list(range(heard[0].event.seq, heard[-1].event.seq + 1))
        assert lab.samples()[0].measurements[0].measurement == measured.id


def test_only_the_older_measurements_go(tmp_path: Path, build: Build, monkeypatch: pytest.MonkeyPatch) -> None:
    from pzctl.daemon.journal import journal_writer as module

    keeper = JournalMaintenance(tmp_path / "journal")
    keeper.append(StateEvent(state="started"))
    ids = []
    for k, day in enumerate(("2026-01-01", "2026-02-01", "2026-03-01")):
        monkeypatch.setattr(module, "now_utc", lambda day=day: f"{day}T00:00:00.000Z")
        ids.append(keeper.begin_measurement(str(k), build, "disk")[0])
        for state in ("queued", "measured"):
            keeper.append(StateEvent(state=state, measurement=ids[-1], sample=SampleStep("s", "disk")))
    assert keeper.prune("2026-01-01", tmp_path / "nothing") == 0, "no measurement is older, so nothing is removed"
    assert keeper.prune("2026-02-01", tmp_path / "copy") == 3
    assert [one.id for one in keeper.measurements()] == ids[1:]
    assert keeper.verify() == []
    assert keeper.prune("2026-02-01", tmp_path / "again") == 0
    with pytest.raises(JournalError, match="this folder is not empty"):
        keeper.prune("2026-03-01", tmp_path / "copy")
    assert [one.id for one in keeper.measurements()] == ids[1:]
    keeper.close()


def test_damage_is_found_and_not_copied(start_daemon, build: Build, tmp_path: Path) -> None:
    start_daemon()
    with connect() as lab:
        lab.measure(build, "disk")
        lab.shutdown()
    array = next((journal_folder(tmp_path) / "arrays").iterdir())
    array.write_bytes(b"x" + array.read_bytes()[1:])
    found = pzctl(tmp_path, "journal", "verify")
    assert (found.returncode, "is not what was written" in found.stdout) == (1, True)
    archive = JournalReader(journal_folder(tmp_path))
    with pytest.raises(JournalError, match="the copy is damaged: event"):
        copy_journal(archive, tmp_path / "copy")
    archive.close()


def test_a_journal_of_version_1_is_copied_and_brought_up_to_date(tmp_path: Path, build: Build) -> None:
    folder = tmp_path / "journal"
    journal = JournalWriter(folder)
    measurement, _ = journal.begin_measurement("r", build, "disk")
    said = journal.append(StateEvent(state="measured", measurement=measurement, sample=SampleStep(build.name, "disk")))[
        1
    ]
    journal.close()
    with sqlite3.connect(folder / "journal.sqlite") as new, sqlite3.connect(tmp_path / "v1.sqlite") as old:
        old.executescript(_STEPS[0] + "PRAGMA user_version=1")
        for table, columns in COLUMNS.items():
            if table not in ("prunings", "gaps", "chain"):
                names = columns.removesuffix(", station")
                marks = ", ".join("?" * len(names.split(", ")))
                rows = new.execute(f"SELECT {names} FROM {table}").fetchall()  # noqa: S608
                old.executemany(f"INSERT INTO {table} ({names}) VALUES ({marks})", rows)  # noqa: S608
    new.close()
    old.close()
    shutil.copy(tmp_path / "v1.sqlite", folder / "journal.sqlite")
    with pytest.raises(JournalError, match="a journal of version 1; this pzctl reads version 4; start the daemon once"):
        JournalReader(folder)
    journal = JournalWriter(folder)
    assert [one.id for one in journal.measurements()] == [measurement]
    assert journal.replay(1, None, 10) == [said]
    assert journal.append(StateEvent(state="started"))[0].seq == 2
    assert journal.verify() == []
    journal.close()
    shutil.copy(folder / "journal.sqlite.v1", tmp_path / "old.sqlite")
    with sqlite3.connect(tmp_path / "old.sqlite") as old:
        assert old.execute("PRAGMA user_version").fetchone() == (1,)
        assert old.execute("SELECT id FROM measurements").fetchall() == [(measurement,)]
    old.close()
