"""The scheduled backup can be restored elsewhere, never overwrites a good copy, and raises an alarm when it fails."""

import asyncio
import os
import shutil
import signal
import sys
from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import numpy as np
import pytest
from command_line import run_here

from pzctl.daemon.cli.bench.status import backup_sentence
from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.backup_plan import BackupPlan
from pzctl.daemon.files.config import ConfigError, options, settings
from pzctl.daemon.files.paths import home
from pzctl.daemon.journal.backup.folder_target import back_up_to_folder
from pzctl.daemon.journal.backup.rsync_target import back_up_by_rsync
from pzctl.daemon.journal.backup.snapshot import snapshot
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.store import JournalError
from pzctl.daemon.page.prometheus_metrics import exposition
from pzctl.daemon.server.workers.backup_schedule import BackupSchedule
from pzctl.daemon.wire.events import InstrumentInfo, SampleStep, StateEvent, SweepEvent, sweep_columns
from pzctl.daemon.wire.frames import to_json
from pzctl.daemon.wire.replies import BackupState
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

SOON = 0.001
"""Hours between two backups in these tests."""


def measure(folder: Path, build: Build, request: str) -> str:
    with closing(JournalWriter(folder)) as journal:
        measurement, _ = journal.begin_measurement(request, build, "disk")
        columns, payload = sweep_columns(Sweep(np.linspace(1e6, 2e6, 51), np.arange(51) + 1j))
        info = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)
        said = {"instrument": info, "build": build, "segment": 1, "segments": 1, "started": "", "settings": {}}
        sample = SampleStep(build.name, "disk")
        journal.append(SweepEvent(measurement=measurement, sample=sample, columns=columns, **said), payload)
        journal.append(StateEvent(state="measured", measurement=measurement, sample=sample))
        return measurement


@pytest.fixture
def journal(tmp_path: Path, build: Build) -> Path:
    """A journal with one measurement."""
    measure(tmp_path / "home" / "journal", build, "1")
    return tmp_path / "home" / "journal"


@pytest.fixture
def share(tmp_path: Path) -> Path:
    """An empty folder on another disk."""
    (tmp_path / "share").mkdir()
    return tmp_path / "share"


def back_up(journal: Path, share: Path, *, again: bool = False) -> None:
    with snapshot(journal) as taken:
        back_up_to_folder(journal, taken, share, again=again)


def measurements(place: Path) -> int:
    with closing(JournalReader(place)) as reader:
        assert reader.verify() == []
        return len(reader.measurements())


def test_restore_drill_of_a_scheduled_backup(
    start_daemon: Callable[..., Location],
    end: Callable[..., None],
    wait_until: Callable[..., None],
    build: Build,
    share: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path / "lost"))
    where = start_daemon(backup=BackupPlan(str(share), SOON / 4))
    with connect() as lab:
        measured = lab.measure(build, "disk")
        began = lab.metrics().counts.get("state-backup-done", 0)
        wait_until(
            lambda: lab.metrics().counts.get("state-backup-done", 0) > began + 1
        )  # one backup began after the sweep
        found = lab.status().backup
        assert found is not None
        assert (found.failed, found.late, found.last_failure) == (False, False, None)
    end(where.pid, signal.SIGKILL)
    shutil.rmtree(tmp_path / "lost")

    shutil.copytree(share / "journal", tmp_path / "restored" / "journal")
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path / "restored"))
    assert measurements(tmp_path / "restored" / "journal") == 1
    start_daemon()
    with connect() as lab:
        events = [event.sweep() for event in lab.sweeps(measured.id)]
        assert all(np.array_equal(a.impedance, b.impedance) for a, b in zip(events, measured.sweeps, strict=True))
        assert lab.measure(build, "ml1").sweeps


def test_a_failed_backup_is_an_alarm_until_one_succeeds(
    start_daemon: Callable[..., Location], wait_until: Callable[..., None], build: Build, tmp_path: Path
) -> None:
    away = tmp_path / "away"
    start_daemon(backup=BackupPlan(str(away), SOON / 8))
    with connect() as lab:
        wait_until(lambda: lab.metrics().counts.get("state-backup-failed"))
        status = lab.status()
        assert status.backup is not None
        assert "ALARM: failed, none yet" in backup_sentence(status.backup)
        assert "this folder does not exist; is the share mounted?" in status.backup.says
        if sys.modules.get("prometheus_client"):
            assert b"pzctl_backup_alarm 1.0" in exposition(lab.metrics(), status)
        assert lab.measure(build, "disk").sweeps, "the daemon continues to measure"
        away.mkdir()
        wait_until(lambda: (now := lab.status().backup) and now.last_success and not now.failed)
        assert b"pzctl_backup_alarm 0.0" in exposition(lab.metrics(), lab.status())
        assert (home() / "backup.json").stat().st_size


def test_a_backup_that_cannot_begin_is_an_alarm_and_the_daemon_continues(tmp_path: Path) -> None:
    (tmp_path / "log").write_text("no folder")
    events: list[StateEvent] = []
    schedule = BackupSchedule(BackupPlan("/nowhere", 24.0), tmp_path, events.append)
    with pytest.raises(asyncio.TimeoutError):
        asyncio.run(asyncio.wait_for(schedule.keep(), 1))
    assert [event.state for event in events] == ["backup-failed"], "and it is not tried again at once"
    assert schedule.state is not None
    assert schedule.state.failed


def test_a_clock_set_back_neither_delays_nor_repeats_backups(tmp_path: Path) -> None:
    ahead = BackupState("/nowhere", 24.0, last_success="2999-01-01T00:00:00Z", last_failure="2999-01-02T00:00:00Z")
    (tmp_path / "backup.json").write_bytes(to_json(ahead))
    (tmp_path / "log").write_text("no folder")
    events: list[StateEvent] = []
    schedule = BackupSchedule(BackupPlan("/nowhere", 24.0), tmp_path, events.append)
    with pytest.raises(asyncio.TimeoutError):
        asyncio.run(asyncio.wait_for(schedule.keep(), 2))
    assert len(events) == 1


def test_the_next_backup_updates_the_copy_and_keeps_the_previous_database(
    journal: Path, share: Path, build: Build
) -> None:
    back_up(journal, share)
    (old,) = (share / "journal" / "arrays").iterdir()
    inode = old.stat().st_ino
    measure(journal, build, "2")
    back_up(journal, share, again=True)
    assert measurements(share / "journal") == 2
    assert old.stat().st_ino == inode, "existing files are not copied again"
    assert (share / "journal" / "journal.sqlite.previous").exists()
    assert old.stat().st_nlink == 1
    assert not (journal.parent / "backup-stage").exists()


def lose(journal: Path, share: Path, build: Build) -> None:
    """A daemon that starts on an empty data folder must not overwrite the backup."""
    shutil.rmtree(journal)
    measure(journal, build, "other")


def unmount(journal: Path, share: Path, build: Build) -> None:
    shutil.rmtree(share / "journal")


def flip(journal: Path, share: Path, build: Build) -> None:
    path = next((share / "journal" / "arrays").iterdir())
    path.write_bytes(b"\1" + path.read_bytes()[1:])


def damage(journal: Path, share: Path, build: Build) -> None:
    with (journal / "journal.sqlite").open("r+b") as file:
        file.truncate(5000)


def lack(journal: Path, share: Path, build: Build) -> None:
    next((journal / "arrays").iterdir()).unlink()
    for path in (share / "journal" / "arrays").iterdir():
        path.unlink()


def use(journal: Path, share: Path, build: Build) -> None:
    (share / "journal" / "journal.sqlite-wal").write_bytes(b"somebody writes here")


def link(journal: Path, share: Path, build: Build) -> None:
    (share / "journal").rename(share / "elsewhere")
    (share / "journal").symlink_to(share / "elsewhere")


@pytest.mark.parametrize(
    ("harm", "says"),
    [
        (link, "this is a symbolic link, which a backup does not follow"),
        (lose, "does not continue the one in the backup"),
        (unmount, "the earlier backup is not there; is the share mounted"),
        (flip, "is not what was written; move that file away"),
        (damage, "journal.sqlite is incomplete"),
        (lack, "this recording is missing"),
        (use, "a daemon uses this backup as its journal"),
    ],
)
def test_a_good_copy_is_never_replaced_by_a_worse_one(
    journal: Path, share: Path, build: Build, harm: Callable[[Path, Path, Build], None], says: str
) -> None:
    back_up(journal, share)
    harm(journal, share, build)
    database = share / "journal" / "journal.sqlite"
    before = database.read_bytes() if database.exists() else None
    with pytest.raises(JournalError, match=says):
        back_up(journal, share, again=True)
    assert (database.read_bytes() if database.exists() else None) == before


@pytest.fixture
def remote(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A program `ssh` that runs the command on this machine."""
    if shutil.which("rsync") is None:
        pytest.skip("rsync is not installed")
    program = tmp_path / "bin" / "ssh"
    program.parent.mkdir()
    program.write_text('#!/bin/sh\nwhile [ "$1" = -o ]; do shift 2; done\nshift\nexec sh -c "$*"\n')
    program.chmod(0o700)
    monkeypatch.setenv("PATH", str(program.parent), prepend=os.pathsep)
    return tmp_path / "share"


def send(journal: Path, target: str, *, again: bool = False) -> None:
    with snapshot(journal) as taken:
        back_up_by_rsync(journal, taken, target, again=again)


def test_a_backup_by_rsync_is_read_back_and_can_be_restored(
    journal: Path, share: Path, remote: Path, build: Build
) -> None:
    target = f"lab:{share}"
    send(journal, target)
    assert measurements(share / "journal") == 1
    measure(journal, build, "2")
    send(journal, target, again=True)
    assert measurements(share / "journal") == 2
    assert (share / "journal" / "journal.sqlite.previous").exists()
    path = next((share / "journal" / "arrays").iterdir())
    times = path.stat()
    path.write_bytes(b"\1" + path.read_bytes()[1:])
    os.utime(path, ns=(times.st_atime_ns, times.st_mtime_ns))
    with pytest.raises(JournalError, match=f"differs from the journal: .*{path.name}"):
        send(journal, target, again=True)
    shutil.rmtree(share / "journal")
    with pytest.raises(JournalError, match="No such file"):
        send(journal, target, again=True)
    with pytest.raises(JournalError, match="rsync ended with status 23"):
        send(journal, f"lab:{share / 'nowhere'}")


def test_a_missing_rsync_is_reported(journal: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PATH", str(tmp_path))
    with pytest.raises(JournalError, match="needs rsync, which is not installed here"):
        send(journal, "lab:/backup")


@pytest.mark.parametrize(
    "table",
    [
        'to = "-e sh"',
        'to = "-oProxyCommand=sh:/x"',
        'to = "relative/folder"',
        'to = "lab:"',
        'to = "lab::module"',
        'to = "/mnt/a\\nb"',
        'to = "/mnt/a"\nevery_hours = 0',
        'to = "/mnt/a"\nevery_hours = true',
        'to = "/mnt/a"\nevery = 24',
        "every_hours = 24",
    ],
)
def test_no_target_is_an_option_or_a_command(table: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    (tmp_path / "config.toml").write_text(f"[backup]\n{table}\n")
    with pytest.raises(ConfigError, match=r"backup is .*allowed is a table with `to`"):
        settings({})


def test_the_table_of_the_config_file_is_read(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    (tmp_path / "config.toml").write_text('[backup]\nto = "bench1@lab.example:/srv/pzctl"\nevery_hours = 6\n')
    assert options(settings({})).backup == BackupPlan("bench1@lab.example:/srv/pzctl", 6)
    monkeypatch.setenv("PZCTL_BACKUP", "/mnt/archive")
    assert options(settings({})).backup == BackupPlan("/mnt/archive", 24)
    with pytest.raises(ConfigError, match="back up a PostgreSQL database with the server's own tools"):
        options(settings({"journal": "postgresql://lab/pzctl"}))


def test_the_command_shows_the_backup(start_daemon: Callable[..., Location], share: Path) -> None:
    start_daemon(backup=BackupPlan(str(share), 24.0))
    shown = run_here(Path(os.environ["PZCTL_HOME"]), "status").stdout
    assert f"backup to {share} every 24 h: " in " ".join(shown.split())
