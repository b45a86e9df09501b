"""Another program locks the journal's database: what is measured is kept and published later, and nobody waits long."""

import signal
import sqlite3
import time
from collections.abc import Callable, Iterator
from contextlib import closing
from pathlib import Path

import pytest

from pzctl.daemon.client.client import Client, connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.wire.events import ReceivedEvent, StateEvent
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

SOON = SweepPlan((Segment(1e6, 6e6, 11),))

LONGEST_ANSWER = 4.0
"""Seconds: two for a database that another program locks, once, and as many for a busy machine."""


@pytest.fixture
def another_program(tmp_path: Path) -> Iterator[Callable[[str], object]]:
    """Return a function that runs a statement in the journal's database as another program."""
    others: list[sqlite3.Connection] = []

    def run(statement: str) -> None:
        if not others:
            others.append(sqlite3.connect(journal_folder(tmp_path) / "journal.sqlite", isolation_level=None))
        others[0].execute(statement)

    yield run
    for other in others:
        other.close()


def wait_for(state: str, events: Iterator[ReceivedEvent], measurement: str) -> None:
    while not (
        isinstance(event := next(events).event, StateEvent) and (event.state, event.measurement) == (state, measurement)
    ):
        pass


def longest_answer(lab: Client, until: Callable[[], bool]) -> float:
    """Return the greatest number of seconds that `status` takes until something is true."""
    longest = 0.0
    while not until():
        began = time.monotonic()
        lab.status()
        longest = max(longest, time.monotonic() - began)
        time.sleep(0.02)
    return longest


def test_a_sweep_that_ends_while_the_database_is_locked_is_published_later(
    start_daemon: Callable[..., Location],
    build: Build,
    another_program: Callable[[str], object],
    tmp_path: Path,
) -> None:
    start_daemon(time_scale=0.15)
    unsaved = tmp_path / "unsaved"
    with connect() as lab:
        events = lab.listen(patience=60)
        running = lab.begin(build, "disk")
        waiting, cancelled = (lab.begin(build, step, SOON) for step in ("ml1", "disk"))
        wait_for("measuring", events, running)
        another_program("BEGIN IMMEDIATE")
        longest = longest_answer(lab, lambda: len(list(unsaved.glob("*.event"))) >= 3)
        print("LONGEST", longest)
        assert longest < LONGEST_ANSWER
        began = time.monotonic()
        for _ in range(3):
            with pytest.raises(DaemonError, match=r"another program has locked journal\.sqlite; nothing is measured"):
                lab.begin(build, "disk")
        assert time.monotonic() - began < LONGEST_ANSWER / 2, "it has waited before"
        lab.cancel(cancelled)
        assert lab.status().queue == (waiting,), "it does not begin"
        another_program("ROLLBACK")
        wait_for("measured", events, running)
        wait_for("cancelled", events, cancelled)
        wait_for("measured", events, waiting)
        assert lab.measure(build, "disk", SOON).sweeps
        seqs = [one.event.seq for one in lab.replay(1)]
        assert seqs == list(range(1, len(seqs) + 1)), "none lost, none twice"
    assert not any(unsaved.iterdir())
    with closing(JournalReader(journal_folder(tmp_path))) as journal:
        assert [one.state for one in journal.measurements()] == ["measured", "measured", "cancelled", "measured"]
        assert journal.verify() == []


def test_such_a_sweep_outlives_the_daemon(
    start_daemon: Callable[..., Location],
    build: Build,
    another_program: Callable[[str], object],
    tmp_path: Path,
    wait_until: Callable[..., None],
    end: Callable[..., None],
) -> None:
    where = start_daemon(time_scale=0.15)
    with connect() as lab:
        events = lab.listen(patience=60)
        running = lab.begin(build, "disk")
        wait_for("measuring", events, running)
        another_program("BEGIN IMMEDIATE")
        wait_until(lambda: len(list((tmp_path / "unsaved").glob("*.event"))) == 3)
    end(where.pid, signal.SIGKILL)
    another_program("ROLLBACK")
    start_daemon()
    with closing(JournalReader(journal_folder(tmp_path))) as journal:
        assert [(one.id, one.state) for one in journal.measurements()] == [(running, "measured")]
        assert len(journal.sweep_ids(running)) == 2
        assert journal.verify() == []
