"""A journal that takes some rows, or none: nothing happens by halves, and stopping needs no journal."""

import json
import resource
import sqlite3
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, closing, contextmanager
from pathlib import Path

import pytest
from keyed import asked

from pzctl.daemon.client import conversations
from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location, find
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import journal_folder, log_file
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.store import JournalError
from pzctl.daemon.wire.events import StateEvent
from pzctl.daemon.wire.frames import to_json
from pzctl.fitters.interface import FitError
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

LONG = SweepPlan(tuple(Segment(1e6, 6e6, 801) for _ in range(200)))

Refusing = Callable[..., AbstractContextManager[None]]


@pytest.fixture
def refusing(tmp_path: Path) -> Refusing:
    """Return a context in which the database takes no event with this text in its header, as if the disk were full."""

    @contextmanager
    def refuse(text: str, name: str = "full") -> Generator[None]:
        with closing(sqlite3.connect(journal_folder(tmp_path) / "journal.sqlite", isolation_level=None)) as db:
            condition = f"instr(CAST(NEW.header AS TEXT), '{text}')"
            full = "SELECT RAISE(ABORT, 'the disk is full')"
            db.execute(f"CREATE TRIGGER '{name}' BEFORE INSERT ON events WHEN {condition} BEGIN {full}; END")
            try:
                yield
            finally:
                db.execute(f"DROP TRIGGER '{name}'")

    return refuse


def states(lab: object, measurement: str) -> list[str]:
    events = [one.event for one in lab.replay(1)]  # type: ignore[attr-defined]
    return [event.state for event in events if isinstance(event, StateEvent) and event.measurement == measurement]


def test_a_measurement_is_recorded_and_queued_or_neither(
    start_daemon: Callable[..., Location], build: Build, refusing: Refusing
) -> None:
    """Its row and the event `queued` are one transaction; the refused request may be repeated."""
    where = start_daemon()
    request = {"request": "measure", "id": "once", "build": json.loads(to_json(build)), "step": "disk"}
    with connect() as lab:
        with refusing('"queued"'):
            refusal = asked(where, where.key, request)
            assert refusal["error"]["code"] == "journal"
            assert "the disk is full" in refusal["error"]["message"]
            assert lab.samples() == ()
        measurement = asked(where, where.key, request)["measurement"]
        assert asked(where, where.key, request)["measurement"] == measurement
        lab.measure(build, "ml1")
        assert states(lab, measurement) == ["queued", "measuring", "measured"]


def test_a_lease_is_neither_taken_nor_returned_if_the_journal_does_not_say_so(
    start_daemon: Callable[..., Location], refusing: Refusing
) -> None:
    where = start_daemon()
    take = {"request": "lease", "id": "1", "owner": "ana", "seconds": 60.0}
    with connect() as lab:
        with refusing('"leased"'):
            assert asked(where, where.key, take)["error"]["code"] == "journal"
            assert lab.status().lease is None
        lease = asked(where, where.key, take)["lease"]
        give_back = {"request": "release", "id": "2", "lease": lease}
        with refusing('"released"'):
            assert asked(where, where.key, give_back)["error"]["code"] == "journal"
        assert lab.status().lease.owner == "ana"
        assert asked(where, where.key, give_back)["ok"]
        assert lab.status().lease is None


def test_a_layer_is_glued_once_though_the_journal_does_not_keep_it(
    start_daemon: Callable[..., Location], refusing: Refusing
) -> None:
    where = start_daemon()
    glue = {"request": "bench", "id": "1", "command": {"command": "next"}}
    with refusing('"bench"'):
        answers = [asked(where, where.key, glue)["answer"]["step"] for _ in range(2)]
    assert answers == ["ml1", "ml1"]


def test_cancel_and_shutdown_need_no_journal(
    start_daemon: Callable[..., Location], build: Build, refusing: Refusing, wait_until, tmp_path: Path
) -> None:
    """A person who stops a measurement, because of its bias for example, is not refused."""
    start_daemon(time_scale=1.0)
    with connect() as lab:
        runs, waits = lab.begin(build, "disk", LONG), lab.begin(build, "disk", LONG)
        wait_until(lambda: lab.status().measuring == runs)
        with refusing('"state"'):
            lab.cancel(waits)
            assert lab.status().queue == ()
            lab.shutdown()
            wait_until(lambda: find(tmp_path) is None)
    log = log_file(tmp_path, "daemon").read_text(encoding="utf-8")
    assert "not in the journal: cancelling  by 'local'" in log
    assert "not in the journal: shutdown  by 'local'" in log


def test_who_waits_for_a_fit_that_could_not_be_kept_is_told(
    start_daemon: Callable[..., Location], build: Build, refusing: Refusing, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conversations, "ASK_AGAIN", 0.5)
    start_daemon()
    with connect() as lab:
        measurement = lab.measure(build, "disk").id
        for work in (lambda: lab.fit(measurement, "mason", 60), lambda: lab.diagnose(measurement, ["cable"], 60)):
            with refusing('"fit"'), refusing('"diagnosis"', "full too"), pytest.raises(DaemonError) as told:
                work()
            assert f"to measurement {measurement} could not be kept: " in str(told.value)
            assert "the disk is full" in str(told.value)
        assert lab.fit(measurement, "mason", 60).steps == ("disk",), "it is done again"


def test_who_waits_for_a_fitter_that_the_daemon_keeps_running_is_told_while_the_disk_is_full(
    start_daemon: Callable[..., Location], build: Build, refusing: Refusing, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(conversations, "ASK_AGAIN", 0.5)
    start_daemon("Echo")
    with connect() as lab:
        with refusing('"fit"'):
            measurement = lab.measure(build, "disk").id
            with pytest.raises(DaemonError) as told:
                lab.wait_fit("guest_examples:Echo", measurement)
        assert told.value.code == "journal"
        assert f"Echo to measurement {measurement} could not be kept: " in str(told.value)
        assert "the disk is full" in str(told.value)
        monkeypatch.setattr(conversations, "ASK_AGAIN", 60.0)
        assert lab.wait_fit("guest_examples:Echo", measurement).steps == ("disk",), "it is done again"


def test_a_measurement_waits_for_a_full_disk_and_whoever_waits_for_it_is_told(
    start_daemon: Callable[..., Location], build: Build, refusing: Refusing, monkeypatch: pytest.MonkeyPatch, wait_until
) -> None:
    monkeypatch.setattr(conversations, "ASK_AGAIN", 0.5)
    start_daemon()
    with connect() as lab:
        with refusing('"measured"'), pytest.raises(DaemonError) as told:
            lab.measure(build, "disk")
        assert "waits until the journal can keep it: " in str(told.value)
        assert "the disk is full" in str(told.value)
        wait_until(lambda: lab.samples()[0].measurements[0].state == "measured")
        measurement = lab.samples()[0].measurements[0].measurement
        assert len(lab.sweeps(measurement)) == 2, "nothing is lost"
        with refusing('"measuring"'):
            gives_up = lab.begin(build, "disk")
            wait_until(lambda: lab.status().measuring == gives_up)
            lab.cancel(gives_up)
            wait_until(lambda: lab.status().measuring is None)
        assert lab.measure(build, "disk").sweeps


def test_a_full_disk_does_not_end_the_daemon_with_its_fitters(
    start_daemon: Callable[..., Location], build: Build, refusing: Refusing, wait_until, tmp_path: Path
) -> None:
    """Neither the journal nor the folder of logs can be written while a fitter answers, ends and is started again."""
    start_daemon("Echo")
    logs = log_file(tmp_path, "daemon").parent
    with connect() as lab:
        wait_until(lambda: lab.status().fitters[0].state == "ready")
        aside = logs.rename(tmp_path / "aside")
        with refusing('"fit"'), refusing('"fitter-', "full too"):
            logs.write_text("no folder of logs can be made here")
            measurement = lab.measure(build, "disk").id
            wait_until(lambda: lab.status().fitters[0].says.startswith("its process could not be run: "))
        with pytest.raises(FitError, match=r"crashed . times over this measurement: its process could not be run: "):
            lab.wait_fit("guest_examples:Echo", measurement)
        with pytest.raises(FitError, match=r"mason of measurement .*: its process could not be run: .*log"):
            lab.fit(measurement, "mason")
        logs.unlink()
        aside.rename(logs)
        assert lab.fit(measurement, "mason").steps == ("disk",)
        wait_until(lambda: lab.status().fitters[0].state == "ready")


def test_an_array_for_which_there_was_no_room_is_written_later(tmp_path: Path) -> None:
    with closing(JournalWriter(tmp_path / "journal")) as journal:
        most = resource.getrlimit(resource.RLIMIT_FSIZE)
        resource.setrlimit(resource.RLIMIT_FSIZE, (100_000, most[1]))
        try:
            with pytest.raises(JournalError, match=r"the journal cannot be read or written: .*File too large"):
                journal.store.write_array("e", bytes(200_000))
        finally:
            resource.setrlimit(resource.RLIMIT_FSIZE, most)
        journal.store.write_array("e", bytes(200_000))
        assert journal.store.read_array("e") == bytes(200_000)


def test_after_a_failed_commit_the_journal_goes_on(tmp_path: Path) -> None:
    def write(journal: JournalWriter) -> None:
        with journal.together():
            journal.append(StateEvent(state="started"))
            journal.store.run("PRAGMA defer_foreign_keys = ON")
            journal.store.run(
                "INSERT INTO measurements VALUES (9, 'm', 'r', 'nobody', 's', 't', 'b', 'queued', '', '')"
            )

    with closing(JournalWriter(tmp_path / "journal")) as journal:
        with pytest.raises(JournalError, match="FOREIGN KEY constraint failed"):
            write(journal)
        assert journal.append(StateEvent(state="started"))[0].seq == 1
        assert journal.verify() == []
