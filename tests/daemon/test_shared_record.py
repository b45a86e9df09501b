"""Several benches keep one record on a PostgreSQL server: as durable as a folder's, and each counts for itself."""

import os
import signal
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

from pzctl import connect
from pzctl.daemon import migrations
from pzctl.daemon.archive import Archive
from pzctl.daemon.connection import DaemonError
from pzctl.daemon.journal import Journal
from pzctl.daemon.launch import start
from pzctl.daemon.options import Options
from pzctl.daemon.retention import Keeper, copy_journal
from pzctl.daemon.store import JournalError
from pzctl.daemon.wire import Sample, StateEvent
from pzctl.models.build import Build

sys.path.insert(0, str(Path(__file__).parent))

import postgres

why_not = postgres.reason_why_not()
pytestmark = pytest.mark.skipif(bool(why_not), reason=why_not)
psycopg = pytest.importorskip("psycopg")


@pytest.fixture(scope="module")
def server() -> Iterator[str]:
    with postgres.server() as url:
        yield url


@pytest.fixture
def url(server: str) -> Iterator[str]:
    """An empty database."""
    yield server
    with psycopg.connect(server, autocommit=True) as db:
        db.execute("DROP SCHEMA public CASCADE; DROP SCHEMA IF EXISTS pzctl_v3 CASCADE; CREATE SCHEMA public")


def pzctl(home: Path, url: str, *words: str) -> "subprocess.CompletedProcess[str]":
    program = Path(sys.executable).with_name("pzctl")
    environment = {**os.environ, "PZCTL_HOME": str(home), "PZCTL_JOURNAL": url, "PZCTL_STATION": "b"}
    return subprocess.run([program, *words], env=environment, capture_output=True, text=True, check=False)


def test_two_benches_one_record(url: str, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk is measured on bench a; bench b measures the next step, knows the first, and fits what a measured."""
    places = {}
    try:
        for station in ("a", "b"):
            monkeypatch.setenv("PZCTL_HOME", str(tmp_path / station))
            simulator = {"time_scale": 0.0}
            places[station] = start(Options(fitters=(), simulator=simulator, journal=url, station=station))
        with (
            connect(places["a"].events, places["a"].requests) as a,
            connect(places["b"].events, places["b"].requests) as b,
        ):
            assert "secret" not in str(a.settings())
            disk = a.measure(build, "disk")
            ml1 = b.measure(build, "ml1")
            heard = b.sweeps(ml1.id)
            assert [one.event.measurement for one in heard] == [disk.id] * 2 + [ml1.id] * 2
            assert heard[0].sweep().impedance.tobytes() == disk.sweeps[0].impedance.tobytes()
            seqs = [one.event.seq for one in b.replay(1)]
            assert seqs == list(range(1, len(seqs) + 1)), "each station counts for itself"
            assert [one.step for one in a.samples()[0].measurements] == ["disk", "ml1"]
        listed = pzctl(tmp_path / "c", url, "samples").stdout
        assert build.name in listed
        told = pzctl(tmp_path / "c", url, "journal", "verify")
        assert "4 arrays: all whole" in told.stdout, told.stderr
        copied = pzctl(tmp_path / "c", url, "journal", "backup", str(tmp_path / "copy"))
        assert "and verified" in copied.stdout, copied.stderr
        copy = Archive(tmp_path / "copy", "b")
        assert (len(copy.measurements()), len(copy.sweeps(disk.id)), copy.verify()) == (2, 2, [])
        copy.close()
        pruned = pzctl(
            tmp_path / "b2", url, "journal", "prune", "--before", "2999-01-01", "--backup", str(tmp_path / "x")
        )
        assert "another daemon writes this journal as station 'b'" in pruned.stderr
        os.kill(places["b"].pid, signal.SIGTERM)
    finally:
        for place in places.values():
            os.kill(place.pid, signal.SIGKILL)


def test_killed_at_any_moment_nothing_announced_is_lost(
    start_daemon, end, url: str, build: Build, tmp_path: Path
) -> None:
    where = start_daemon(journal=url, station="a")
    with connect() as lab:
        events = lab.listen(patience=5)
        for _ in range(20):
            lab.begin(build, "disk")
        heard = [next(events) for _ in range(30)]
        end(where.pid, signal.SIGKILL)
        again = start_daemon(journal=url, station="a")
    with connect() as lab:
        recorded = {one.event.seq: one.event for one in lab.replay(1)}
        assert all(recorded[one.event.seq] == one.event for one in heard)
        states = {one.state for one in lab.samples()[0].measurements}
        assert states <= {"measured", "abandoned"}
        assert again.run == lab.hello().run != where.run
    archive = Archive(url, "a")
    assert archive.verify() == []
    archive.close()


def test_a_server_that_goes_away_ends_the_daemon_before_it_says_what_it_has_not_kept(
    start_daemon, url: str, build: Build
) -> None:
    where = start_daemon(journal=url, station="a")
    with connect() as lab:
        measured = lab.measure(build, "disk").id
        with psycopg.connect(url, autocommit=True) as db:
            db.execute("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid != pg_backend_pid()")
        with pytest.raises(DaemonError, match="the journal cannot be read or written"):
            lab.begin(build, "disk")
    with pytest.raises(JournalError, match=r"pzctl:\*\*\*@/gone.*the journal cannot be read or written"):
        Archive(url.replace("/record", "/gone"))
    archive = Archive(url)
    assert [one.id for one in archive.measurements()] == [measured]
    archive.close()
    assert where.journal == url


def test_a_folder_moves_to_the_server_and_is_pruned_there(url: str, build: Build, tmp_path: Path) -> None:
    journal = Journal(tmp_path / "journal")
    measurement, _ = journal.begin_measurement("r", build, "disk")
    said = journal.append(StateEvent(state="measured", measurement=measurement, sample=Sample(build.name, "disk")))[1]
    copy_journal(journal, url, "old")
    with pytest.raises(JournalError, match="station 'old' is in this journal already"):
        copy_journal(journal, url, "old")
    journal.close()
    keeper = Keeper(tmp_path / "other", url, "old")
    with pytest.raises(JournalError, match="another daemon writes this journal as station 'old'"):
        Journal(tmp_path / "third", url, "old")
    other = Journal(tmp_path / "third", url, "new")
    kept, _ = other.begin_measurement("s", build, "disk")
    other.append(StateEvent(state="measured", measurement=kept, sample=Sample(build.name, "disk")))
    assert keeper.replay(1, None, 10) == [said]
    assert keeper.prune("2999-01-01", tmp_path / "backup") == 1
    assert [one.id for one in keeper.measurements()] == [kept], "nothing of another station goes"
    assert (keeper.verify(), keeper.append(StateEvent(state="started"))[0].seq) == ([], 2)
    other.close()
    keeper.close()


def test_tables_change_when_nobody_writes_them_and_are_copied_first(
    url: str, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = Journal(tmp_path / "journal", url, "a")
    measurement, _ = journal.begin_measurement("r", build, "disk")
    monkeypatch.setattr(migrations, "VERSION", 4)
    monkeypatch.setattr(migrations, "PATIENCE", 0.1)
    monkeypatch.setattr(
        migrations, "_POSTGRES_STEPS", (*migrations._POSTGRES_STEPS, "ALTER TABLE runs ADD COLUMN x INT")
    )
    with pytest.raises(JournalError, match="of version 3, and a daemon of an older pzctl writes it"):
        Journal(tmp_path / "later", url, "b")
    journal.close()
    with pytest.raises(JournalError, match="of version 3; version 4 is read here; start the daemon once"):
        Archive(url)
    later = Archive(url, write=True)
    assert [one.id for one in later.measurements()] == [measurement]
    assert later.store.all("SELECT id FROM pzctl_v3.measurements") == [(measurement,)]
    later.close()
