"""Several benches share a journal on a PostgreSQL server: as durable as a folder, with separate numbering per bench."""

import os
import signal
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path

import postgres
import pytest
from command_line import run_here

from pzctl import connect
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.daemon_options import DaemonOptions
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.retention import JournalMaintenance, copy_journal
from pzctl.daemon.journal.store import JournalAway, JournalError
from pzctl.daemon.journal.stores import migrations, postgres_store
from pzctl.daemon.server.launch import start
from pzctl.daemon.wire.curve_keys import write_secret
from pzctl.daemon.wire.events import SampleStep, StateEvent
from pzctl.daemon.wire.frames import to_json
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

why_not = postgres.reason_why_not()
pytestmark = pytest.mark.skipif(bool(why_not), reason=why_not)
psycopg = pytest.importorskip("psycopg")


ECHO = "guest_examples:Echo"
SOON = SweepPlan((Segment(1e6, 6e6, 5), Segment(5e5, 15.5e6, 5)))
"""A plan that takes a moment, while the build's own plan takes seconds."""


@pytest.fixture(scope="module")
def server() -> Iterator[postgres.Server]:
    with postgres.running() as found:
        yield found


@pytest.fixture
def restartable(server: postgres.Server) -> Iterator[tuple[Callable[[], None], Callable[[], None]]]:
    """Functions that kill the server and start it again; it runs again after the test."""
    yield server.stop, server.start
    server.start()


@pytest.fixture
def url(server: postgres.Server) -> Iterator[str]:
    """An empty database."""
    yield server.url
    with psycopg.connect(server.url, autocommit=True) as db:
        db.execute("DROP SCHEMA public CASCADE; DROP SCHEMA IF EXISTS pzctl_v4 CASCADE; CREATE SCHEMA public")


@pytest.fixture
def impatient(monkeypatch: pytest.MonkeyPatch) -> None:
    """Whoever finds a station taken is told at once, instead of waiting for its daemon to end."""
    monkeypatch.setattr(postgres_store, "PATIENCE", 0.1)


def pzctl(home: Path, url: str, *words: str) -> "subprocess.CompletedProcess[str]":
    return run_here(home, *words, environment={"PZCTL_JOURNAL": url, "PZCTL_STATION": "b"})


@pytest.mark.usefixtures("impatient")
def test_two_benches_one_record(url: str, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The disk is measured on bench a; bench b measures the next step, knows the first, and fits a's measurement."""
    places, keys = {}, {}
    try:
        for station in ("a", "b"):
            monkeypatch.setenv("PZCTL_HOME", str(tmp_path / station))
            simulator = {"time_scale": 0.0}
            places[station] = start(DaemonOptions(fitters=(), simulator=simulator, journal=url, station=station))
            keys[station] = tmp_path / f"{station}.key"
            write_secret(keys[station], to_json(places[station].key))
        with (
            connect(places["a"].events, places["a"].requests, keys["a"]) as a,
            connect(places["b"].events, places["b"].requests, keys["b"]) as b,
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
        assert "4 arrays: all intact" in told.stdout, told.stderr
        copied = pzctl(tmp_path / "c", url, "journal", "backup", str(tmp_path / "copy"))
        assert "and verified" in copied.stdout, copied.stderr
        copy = JournalReader(tmp_path / "copy", "b")
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
        events = lab.listen(patience=60)
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
    archive = JournalReader(url, "a")
    assert archive.verify() == []
    archive.close()


def test_a_server_that_goes_away_and_comes_back_is_given_what_it_missed(
    start_daemon, url: str, restartable, build: Build, tmp_path: Path, wait_until
) -> None:
    """While it is away no measurement begins; the running one is finished and is kept for the server's return."""
    stop_server, start_server = restartable
    start_daemon("Echo", journal=url, station="a", time_scale=0.15)
    with connect() as lab:
        lab.wait_fit(ECHO, lab.measure(build, "disk", SOON).id, patience=60)
        events = lab.listen(patience=60)
        running, waiting = lab.begin(build, "disk"), lab.begin(build, "ml1", SOON)
        while not (isinstance(event := next(events).event, StateEvent) and event.state == "measuring"):
            pass
        stop_server()
        wait_until(lambda: any((tmp_path / "unsaved").glob("*.event")))
        with pytest.raises(DaemonError, match="the journal's server is away, and nothing is measured until it is"):
            lab.begin(build, "disk")
        with pytest.raises(DaemonError, match="the journal cannot be read"):
            lab.samples()
        assert lab.status().queue == (waiting,), "the daemon answers; queued measurements do not begin"
        start_server()
        ended: list[str | None] = []
        while len(ended) < 2:
            if isinstance(event := next(events).event, StateEvent) and event.state == "measured":
                ended.append(event.measurement)
        assert ended == [running, waiting]
        again = lab.measure(build, "disk", SOON)
        assert len(again.sweeps) == 2
        seqs = [one.event.seq for one in lab.replay(1)]
        assert seqs == list(range(1, len(seqs) + 1)), "none lost, none twice"
    assert not any((tmp_path / "unsaved").iterdir())
    archive = JournalReader(url, "a")
    assert [one.state for one in archive.measurements()] == ["measured"] * 4
    assert archive.verify() == []
    archive.close()


def test_what_was_measured_while_the_server_was_gone_outlives_the_daemon(
    start_daemon, url: str, restartable, build: Build, tmp_path: Path, wait_until, end
) -> None:
    stop_server, start_server = restartable
    where = start_daemon(journal=url, station="a", time_scale=0.15)
    with connect() as lab:
        events = lab.listen(patience=60)
        running = lab.begin(build, "disk")
        while not (isinstance(event := next(events).event, StateEvent) and event.state == "measuring"):
            pass
        stop_server()
        wait_until(lambda: len(list((tmp_path / "unsaved").glob("*.event"))) == 3)
    end(where.pid, signal.SIGKILL)
    start_server()
    start_daemon(journal=url, station="a")
    archive = JournalReader(url, "a")
    assert [(one.id, one.state) for one in archive.measurements()] == [(running, "measured")]
    assert len(archive.sweep_ids(running)) == 2
    assert archive.verify() == []
    archive.close()


def test_a_record_that_another_wrote_meanwhile_is_not_gone_on_with(url: str, tmp_path: Path) -> None:
    journal = JournalWriter(tmp_path / "one", url, "a")
    journal.append(StateEvent(state="started"))
    with psycopg.connect(url, autocommit=True) as db:
        db.execute("SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE pid != pg_backend_pid()")
    with pytest.raises(JournalAway, match=r"pzctl:\*\*\*@.*the journal's server is away"):
        journal.append(StateEvent(state="started"))
    other = JournalWriter(tmp_path / "other", url, "a")
    other.append(StateEvent(state="started"))
    other.close()
    assert journal.store.gone
    with pytest.raises(JournalError, match="ended at event 1 when its server went away, and ends at 2 now"):
        journal.resume(journal.reopened())
    journal.close()
    with pytest.raises(JournalAway, match=r"pzctl:\*\*\*@/gone.*the journal cannot be read or written"):
        JournalReader(url.replace("/record", "/gone"))


@pytest.mark.usefixtures("impatient")
def test_a_server_that_stands_still_is_away_until_it_goes_on(
    url: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its kernel keeps the connection, and no statement ends: the daemon waited for ever, also when it had to end."""
    monkeypatch.setattr(postgres_store, "LONGEST_SILENCE", 0.3)
    journal = JournalWriter(tmp_path / "one", url, "a")
    ((still,),) = journal.store.all("SELECT pg_backend_pid()")
    os.kill(still, signal.SIGSTOP)
    try:
        with pytest.raises(JournalAway, match=r"it has said nothing for 0\.3 s"):
            journal.append(StateEvent(state="started"))
        with pytest.raises(JournalAway, match="its server still has the earlier connection of station 'a'"):
            journal.reopened()
    finally:
        os.kill(still, signal.SIGCONT)
    monkeypatch.setattr(postgres_store, "PATIENCE", 20.0)
    journal.resume(journal.reopened())
    assert journal.append(StateEvent(state="started"))[0].seq == 1
    journal.close()


@pytest.mark.usefixtures("impatient")
def test_a_folder_moves_to_the_server_and_is_pruned_there(url: str, build: Build, tmp_path: Path) -> None:
    journal = JournalWriter(tmp_path / "journal")
    measurement, _ = journal.begin_measurement("r", build, "disk")
    said = journal.append(StateEvent(state="measured", measurement=measurement, sample=SampleStep(build.name, "disk")))[
        1
    ]
    copy_journal(journal, url, "old")
    with pytest.raises(JournalError, match="station 'old' is in this journal already"):
        copy_journal(journal, url, "old")
    journal.close()
    keeper = JournalMaintenance(tmp_path / "other", url, "old")
    with pytest.raises(JournalError, match="another daemon writes this journal as station 'old'"):
        JournalWriter(tmp_path / "third", url, "old")
    other = JournalWriter(tmp_path / "third", url, "new")
    kept, _ = other.begin_measurement("s", build, "disk")
    other.append(StateEvent(state="measured", measurement=kept, sample=SampleStep(build.name, "disk")))
    assert keeper.replay(1, None, 10) == [said]
    assert keeper.prune("2999-01-01", tmp_path / "backup") == 1
    assert [one.id for one in keeper.measurements()] == [kept], "nothing of another station goes"
    assert (keeper.verify(), keeper.append(StateEvent(state="started"))[0].seq) == ([], 2)
    other.close()
    keeper.close()


def test_tables_change_when_nobody_writes_them_and_are_copied_first(
    url: str, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    journal = JournalWriter(tmp_path / "journal", url, "a")
    measurement, _ = journal.begin_measurement("r", build, "disk")
    monkeypatch.setattr(migrations, "VERSION", 5)
    monkeypatch.setattr(migrations, "PATIENCE", 0.1)
    monkeypatch.setattr(
        migrations, "_POSTGRES_STEPS", (*migrations._POSTGRES_STEPS, "ALTER TABLE runs ADD COLUMN x INT")
    )
    with pytest.raises(JournalError, match="has version 4, and a daemon of an older pzctl writes it"):
        JournalWriter(tmp_path / "later", url, "b")
    journal.close()
    with pytest.raises(JournalError, match="of version 4; this pzctl reads version 5; start the daemon once"):
        JournalReader(url)
    later = JournalReader(url, write=True)
    assert [one.id for one in later.measurements()] == [measurement]
    assert later.store.all("SELECT id FROM pzctl_v4.measurements") == [(measurement,)]
    later.close()
