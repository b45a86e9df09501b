"""A journal on a PostgreSQL server: changes are detected as in a folder, and a wrong clock does not end its daemon."""

import time
from collections.abc import Iterator
from pathlib import Path

import postgres
import pytest

from pzctl.daemon.journal.integrity.seals import keep_public_key, make_key, read_public_key, seal_faults, seal_head
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.retention import JournalMaintenance, copy_journal
from pzctl.daemon.journal.stores import migrations
from pzctl.daemon.journal.stores.chain import head_of
from pzctl.daemon.wire.events import SampleStep, StateEvent
from pzctl.models.build import Build

why_not = postgres.reason_why_not()
pytestmark = pytest.mark.skipif(bool(why_not), reason=why_not)
psycopg = pytest.importorskip("psycopg")


@pytest.fixture(scope="module")
def server() -> Iterator[postgres.Server]:
    with postgres.running() as found:
        yield found


@pytest.fixture
def url(server: postgres.Server) -> Iterator[str]:
    """An empty database."""
    yield server.url
    with psycopg.connect(server.url, autocommit=True) as db:
        db.execute("DROP SCHEMA public CASCADE; DROP SCHEMA IF EXISTS pzctl_v3 CASCADE; CREATE SCHEMA public")


def measure(journal: JournalWriter, build: Build, request: str) -> str:
    measurement, _ = journal.begin_measurement(request, build, "disk")
    for state in ("measuring", "measured"):
        journal.append(StateEvent(state=state, measurement=measurement, sample=SampleStep(build.name, "disk")))
    return measurement


def faults(url: str) -> list[str]:
    reader = JournalReader(url)
    try:
        return reader.verify()
    finally:
        reader.close()


def test_a_clock_set_back_does_not_end_the_daemon(url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The daemon's run is the last one that began, whatever the clock said."""
    earlier = JournalWriter(tmp_path / "one", url, "a")
    earlier.append(StateEvent(state="started"))
    earlier.close()
    now = time.time_ns
    monkeypatch.setattr("time.time_ns", lambda: now() - 86_400_000_000_000)
    journal = JournalWriter(tmp_path / "one", url, "a")
    assert journal.run < earlier.run, "ids go back with the clock"
    journal.append(StateEvent(state="started"))
    with psycopg.connect(url, autocommit=True) as db:
        db.execute("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid != pg_backend_pid()")
    journal.resume(journal.reopened())
    assert journal.append(StateEvent(state="started"))[0].seq == 3
    assert journal.verify() == []
    journal.close()


@pytest.mark.parametrize(
    ("statement", "says"),
    [
        ("UPDATE events SET header = 'x' WHERE seq = 1 AND station = 'a'", "event 1 of station a: its row is not"),
        ("UPDATE builds SET json = 'x'", "is not what was written"),
        ("DELETE FROM events WHERE seq = 2 AND station = 'b'", "event 2 of station b is missing"),
        ("UPDATE measurements SET state = 'failed' WHERE station = 'a'", "of station a: the row is not what was"),
    ],
)
def test_what_is_changed_is_found(url: str, build: Build, tmp_path: Path, statement: str, says: str) -> None:
    for station in ("a", "b"):
        journal = JournalWriter(tmp_path / station, url, station)
        measure(journal, build, station)
        journal.close()
    assert faults(url) == []
    with psycopg.connect(url, autocommit=True) as db:
        db.execute(statement)
    assert any(says in fault for fault in faults(url)), faults(url)


def test_a_seal_on_a_server_detects_changes(url: str, build: Build, tmp_path: Path) -> None:
    journal = JournalWriter(tmp_path / "a", url, "a")
    measure(journal, build, "1")
    private, public = tmp_path / "private.pem", tmp_path / "public.pem"
    make_key(private)
    keep_public_key(private, public)
    seal = seal_head(head_of(journal.store, "a"), "a", private)
    measure(journal, build, "2")
    assert seal_faults(journal.store, [seal], read_public_key(public)) == []
    with psycopg.connect(url, autocommit=True) as db:
        db.execute("UPDATE chain SET link = 'x' WHERE number = %s", (seal.number,))
    (fault,) = seal_faults(journal.store, [seal], read_public_key(public))
    assert "the chain was rewritten since" in fault
    journal.close()


def test_the_chain_holds_after_pruning_and_copying(url: str, build: Build, tmp_path: Path) -> None:
    for station in ("a", "b"):
        journal = JournalWriter(tmp_path / station, url, station)
        measure(journal, build, station)
        journal.close()
    keeper = JournalMaintenance(tmp_path / "a", url, "a")
    assert keeper.prune("2999-01-01", tmp_path / "backup") == 2
    measure(keeper, build, "again")
    assert keeper.verify() == []
    copy_journal(keeper, tmp_path / "copy")
    keeper.close()
    for folder in ("backup", "copy"):
        copy = JournalReader(tmp_path / folder)
        assert copy.verify() == []
        copy.close()


def test_tables_of_version_3_are_chained(
    url: str, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    with psycopg.connect(url, autocommit=True) as db:
        db.execute(migrations._POSTGRES)
        db.execute("INSERT INTO runs VALUES ('r2', '2026-01-02', 'a'), ('r1', '2026-01-01', 'a')")
        db.execute("INSERT INTO events VALUES (1, 'state', 'e', NULL, 't', 'h', '', NULL, 'a')")
    journal = JournalWriter(tmp_path / "a", url, "a")
    assert journal.verify() == []
    assert [row[0] for row in journal.store.all("SELECT id FROM runs ORDER BY number")] == ["r1", "r2", journal.run]
    measure(journal, build, "1")
    assert journal.verify() == []
    journal.close()
    with psycopg.connect(url, autocommit=True) as db:
        db.execute("UPDATE events SET header = 'x' WHERE seq = 1")
    assert faults(url) == ["event 1 of station a: its row is not what was written"]
