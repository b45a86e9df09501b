"""Changes to written data are detected by the hash chain, by the database's own check, or by the seal."""

import json
import sqlite3
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import zmq
from command_line import run_here
from keyed import unlocked

from pzctl import connect
from pzctl.daemon.client.conversations import MissingEventsWarning
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.retention import JournalMaintenance, copy_journal
from pzctl.daemon.journal.store import JournalError
from pzctl.daemon.journal.stores.chain import COLUMNS, GENESIS, link_after, row_digest, row_key
from pzctl.daemon.journal.stores.migrations import _STEPS
from pzctl.daemon.wire.events import SampleStep, StateEvent
from pzctl.models.build import Build

Change = Callable[[sqlite3.Connection], object]


def measure(journal: JournalWriter, build: Build, request: str) -> str:
    measurement, _ = journal.begin_measurement(request, build, "disk")
    for state in ("measuring", "measured"):
        journal.append(StateEvent(state=state, measurement=measurement, sample=SampleStep(build.name, "disk")))
    return measurement


@pytest.fixture
def plain_socket() -> "Iterator[zmq.Socket[bytes]]":
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.DEALER) as link:
        link.set(zmq.LINGER, 0)
        link.set(zmq.RCVTIMEO, 20_000)
        yield link
    context.term()


@pytest.fixture
def folder(tmp_path: Path, build: Build) -> Path:
    """A journal of two measurements."""
    journal = JournalWriter(tmp_path / "journal")
    journal.append(StateEvent(state="started"))
    measure(journal, build, "1")
    measure(journal, build, "2")
    journal.close()
    return tmp_path / "journal"


def change(folder: Path, do: Change) -> None:
    db = sqlite3.connect(folder / "journal.sqlite")
    do(db)
    db.commit()
    db.close()


def faults(folder: Path) -> list[str]:
    reader = JournalReader(folder)
    try:
        return reader.verify()
    finally:
        reader.close()


def pzctl(home: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    return run_here(home, *words)


@pytest.mark.parametrize(
    ("statement", "says"),
    [
        (
            "UPDATE events SET header = CAST(replace(header, 'started', 'stopped') AS BLOB) WHERE seq = 1",
            "event 1: its row is not what was written",
        ),
        ("UPDATE events SET topic = x'00' WHERE seq = 3", "event 3: its row is not what was written"),
        ("UPDATE builds SET json = CAST(replace(json, '1', '2') AS BLOB)", "is not what was written"),
        ("UPDATE measurements SET sample = 'another' WHERE number = 1", "the row is not what was written"),
        ("UPDATE measurements SET state = 'failed' WHERE number = 2", "the row is not what was written"),
        ("UPDATE runs SET time = '2000-01-01'", "the row is not what was written"),
        ("UPDATE events SET lengths = x'00', hash = 'x' WHERE seq = 2", "event 2: its row is not what was written"),
        ("UPDATE chain SET subject = x'00' WHERE number = 5", "entry 5 of the chain does not follow"),
        ("DELETE FROM events WHERE seq = 5", "event 5 is missing"),
        ("DELETE FROM measurements WHERE number = 2", "the row is missing"),
        ("DELETE FROM chain WHERE number = 3", "entry 3 of the chain is missing: the next one is 4"),
        ("UPDATE chain SET digest = 'x' WHERE number = 3", "entry 3 of the chain does not follow from the one before"),
        ("INSERT INTO prunings VALUES (5, '2026-01-01', 'nowhere', '')", "prunings 5: the row is in no entry"),
        ("INSERT INTO gaps VALUES (1, 9, '2026-01-01', 'lost', '')", "gaps 1: the row is in no entry of the chain"),
        (
            "INSERT INTO events SELECT 6, kind, 'x', measurement, topic, header, lengths, hash, station FROM events"
            " WHERE seq = 5",
            "event 6 is in no entry of the chain",
        ),
    ],
)
def test_what_is_changed_is_found(folder: Path, statement: str, says: str) -> None:
    assert faults(folder) == []
    change(folder, lambda db: db.execute(statement))
    assert any(says in fault for fault in faults(folder)), faults(folder)


def test_a_damaged_database_is_reported(folder: Path) -> None:
    path = folder / "journal.sqlite"
    db = sqlite3.connect(path)
    (page,) = db.execute("SELECT rootpage FROM sqlite_master WHERE name = 'events_by_measurement'").fetchone()
    (measurement,) = db.execute("SELECT id FROM measurements WHERE number = 2").fetchone()
    db.close()
    data = bytearray(path.read_bytes())
    data[data.index(measurement.encode(), (page - 1) * 4096)] ^= 1  # one bit of an index, which does not affect any row
    path.write_bytes(data)
    told = pzctl(folder.parent, "journal", "verify")
    assert (told.returncode, "journal.sqlite is damaged" in told.stdout + told.stderr) == (1, True), told


def test_pruning_is_part_of_the_chain(folder: Path, tmp_path: Path, build: Build) -> None:
    keeper = JournalMaintenance(folder)
    before = keeper.store.all("SELECT number, link FROM chain")
    assert keeper.prune("2999-01-01", tmp_path / "backup") == 5
    assert keeper.verify() == []
    measure(keeper, build, "3")
    assert keeper.verify() == []
    assert keeper.store.all("SELECT number, link FROM chain")[: len(before)] == before, "nothing of the chain goes"
    assert [(hole.first, hole.last) for hole in keeper.missing(1, 7)] == [(1, 5)]
    keeper.close()
    assert faults(tmp_path / "backup") == []
    change(folder, lambda db: db.execute("DELETE FROM prunings"))
    assert "event 1 is missing" in faults(folder)


def test_a_copy_under_another_name_keeps_the_chain(folder: Path, tmp_path: Path) -> None:
    reader = JournalReader(folder)
    copy_journal(reader, tmp_path / "copy", "bench1")
    reader.close()
    copy = JournalReader(tmp_path / "copy", "bench1")
    assert (copy.verify(), copy.newest) == ([], 5)
    copy.close()


def test_an_older_journal_is_chained_as_it_is(folder: Path, tmp_path: Path, build: Build) -> None:
    old = tmp_path / "old"
    old.mkdir()
    db = sqlite3.connect(old / "journal.sqlite")
    db.executescript("".join(_STEPS[:3]) + "PRAGMA user_version=3")
    db.execute("ATTACH ? AS new", (str(folder / "journal.sqlite"),))
    for table in ("builds", "runs", "measurements", "events", "fits"):
        names = ", ".join(row[1] for row in db.execute(f"PRAGMA main.table_info({table})"))
        db.execute(f"INSERT INTO main.{table} ({names}) SELECT {names} FROM new.{table}")  # noqa: S608
    db.commit()
    db.close()
    with pytest.raises(JournalError, match="a journal of version 3"):
        JournalReader(old)
    JournalWriter(old).close()
    assert faults(old) == []
    assert (old / "journal.sqlite.v3").exists()
    change(old, lambda db: db.execute("UPDATE events SET topic = x'00' WHERE seq = 2"))
    assert faults(old) == ["event 2: its row is not what was written"]


def rewrite(db: sqlite3.Connection) -> None:
    """Change an event and recompute the whole chain, as the owner of the file could."""
    db.execute("UPDATE events SET header = CAST(replace(header, 'started', 'stopped') AS BLOB) WHERE seq = 1")
    row = db.execute(f"SELECT {COLUMNS['events']} FROM events WHERE seq = 1").fetchone()  # noqa: S608
    link = GENESIS
    for number, kind, key, digest in db.execute("SELECT number, kind, subject, digest FROM chain").fetchall():
        new = row_digest(row) if (kind, key) == ("events", row_key("events", row)) else digest
        link = link_after(link, number, kind, key, new)
        db.execute("UPDATE chain SET digest = ?, link = ? WHERE number = ?", (new, link, number))


def test_a_chain_that_was_written_anew_breaks_the_seal(folder: Path, build: Build) -> None:
    home = folder.parent
    told = pzctl(home, "journal", "seal", "--json")
    assert json.loads(told.stdout)["number"] > 5, told.stderr
    assert (home / "seal" / "private.pem").stat().st_mode & 0o077 == 0
    journal = JournalWriter(folder)
    measure(journal, build, "3")
    journal.close()
    whole = pzctl(home, "journal", "verify")
    assert (whole.returncode, "sealed up to entry" in whole.stdout) == (0, True), whole
    change(folder, rewrite)
    assert faults(folder) == [], "the chain alone holds"
    told = pzctl(home, "journal", "verify")
    assert (told.returncode, "is not valid: the chain was rewritten since" in told.stdout) == (1, True), told


def test_a_seal_by_another_key_or_a_missing_seal_is_reported(folder: Path, tmp_path: Path) -> None:
    home = folder.parent
    public = tmp_path / "kept.pem"
    assert pzctl(home, "journal", "seal").returncode == 0
    public.write_bytes((home / "seal" / "public.pem").read_bytes())
    seals = (folder / "seals.jsonl").read_bytes()
    for path in (*(home / "seal").iterdir(), folder / "seals.jsonl"):
        path.unlink()
    assert pzctl(home, "journal", "seal").returncode == 0, "an intruder seals with a key of their own"
    told = pzctl(home, "journal", "verify", "--public-key", str(public))
    assert (told.returncode, "was not made with this journal's key" in told.stdout) == (1, True), told
    (folder / "seals.jsonl").unlink()
    told = pzctl(home, "journal", "verify", "--public-key", str(public))
    assert (told.returncode, "its file of seals was removed" in told.stdout) == (1, True), told
    (tmp_path / "kept.jsonl").write_bytes(seals)
    words = ("--public-key", str(public), "--seals", str(tmp_path / "kept.jsonl"))
    assert pzctl(home, "journal", "verify", *words).returncode == 0


def test_a_forged_seal_does_not_hold(folder: Path) -> None:
    home = folder.parent
    assert pzctl(home, "journal", "seal").returncode == 0
    path = folder / "seals.jsonl"
    seal = json.loads(path.read_text())
    path.write_text(json.dumps(seal | {"number": seal["number"] - 1}) + "\n")
    told = pzctl(home, "journal", "verify")
    assert (told.returncode, "was not made with this journal's key" in told.stdout) == (1, True), told


def test_a_damaged_journal_is_not_sealed(folder: Path) -> None:
    change(folder, lambda db: db.execute("UPDATE events SET topic = x'00' WHERE seq = 2"))
    told = pzctl(folder.parent, "journal", "seal")
    assert (told.returncode, "not sealed, because the journal is damaged" in told.stderr) == (1, True), told


def test_a_replay_over_what_was_pruned_says_so(start_daemon, build: Build, tmp_path: Path, plain_socket) -> None:
    journal = JournalMaintenance(journal_folder(tmp_path))
    measure(journal, build, "1")
    journal.prune("2999-01-01", tmp_path / "backup")
    journal.close()
    where = start_daemon()
    unlocked(plain_socket, where).connect(where.requests)
    plain_socket.send(b'{"id":"r","request":"replay","since":1}')
    answer = json.loads(plain_socket.recv_multipart()[0])
    (hole,) = answer["missing"]
    assert (hole["first"], hole["last"]) == (1, 2)
    assert f"after a copy to {tmp_path / 'backup'}" in hole["says"]
    with (
        connect() as lab,
        pytest.warns(MissingEventsWarning, match="events 1 to 2 are no longer in the journal"),
    ):
        assert next(lab.replay(1)).event.seq == 3
