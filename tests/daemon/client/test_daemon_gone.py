"""A daemon that is killed while it measures may leave a bias on: whoever waits is told, in one sentence."""

import asyncio
import os
import signal
import sys
import threading
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from rich.console import Console

from pzctl.daemon.cli.bench import measure
from pzctl.daemon.client import event_follower, protocol
from pzctl.daemon.client.async_client import connect_async
from pzctl.daemon.client.client import connect
from pzctl.daemon.client.conversations import Conversations
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import Ask, Conversation, DaemonError, Hear, Underway
from pzctl.daemon.client.result_waiter import Measurement
from pzctl.daemon.server.launch import last_words
from pzctl.daemon.wire.events import WELCOME, InstrumentInfo
from pzctl.daemon.wire.frames import to_json
from pzctl.daemon.wire.replies import BenchAnswer, HelloAnswer, MeasureAnswer
from pzctl.daemon.wire.requests import BenchRequest
from pzctl.daemon.wire.uuid7 import uuid7
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

BIASED = "; the bias of 5 V may still be on: switch it off at the analyzer, or start a daemon, which does it first"
GONE = "daemon at E: silent for 0 s; it has ended or hangs"
NO_ANSWER = "daemon at R: no answer in 4 tries of 5 s; is it running?"


def measuring(build: Build, bias_V: float) -> Underway[Measurement]:
    """Return a measurement up to its request."""
    assert build.plan is not None
    underway = Underway(Conversations("E", "R").measure(build, "disk", replace(build.plan, bias_V=bias_V)))
    hello = HelloAnswer(
        id="1", wire=1, version="1", pid=1, run="", seq=3, events="", requests="", bench=None, fitters=(),
        instrument=InstrumentInfo("R", "", "4294A", "", "", simulated=False),
    )  # fmt: skip
    for outcome in ([to_json(hello)], None, [WELCOME]):
        underway.go_on(outcome)
    assert isinstance(underway.step, Ask)
    return underway


def begin(underway: Underway[Measurement]) -> None:
    assert isinstance(underway.step, Ask)
    underway.go_on([to_json(MeasureAnswer(id=underway.step.requests[0], measurement="M"))])
    assert isinstance(underway.step, Hear)


def nobody_answers(underway: Underway[Measurement]) -> None:
    for _ in range(4):
        assert isinstance(underway.step, Ask)
        underway.go_on(None)


@pytest.mark.parametrize(("bias_V", "says"), [(5.0, GONE + BIASED), (0.0, GONE)])
def test_a_daemon_that_falls_silent(monkeypatch: pytest.MonkeyPatch, build: Build, bias_V: float, says: str) -> None:
    monkeypatch.setattr(event_follower, "SILENCE", 0.0)
    underway = measuring(build, bias_V)
    begin(underway)
    with pytest.raises(DaemonError) as gone:
        underway.go_on(None)
    assert str(gone.value) == says


def test_who_waits_for_a_killed_daemon_is_told_that_nobody_listens(
    start_daemon: Callable[..., Location], build: Build, end: Callable[..., None], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_follower, "SILENCE", 90.0)
    monkeypatch.setattr(event_follower, "QUIET", 0.5)
    for asynchronous in (False, True):
        where = start_daemon(time_scale=1.0)

        def kill(_: object, pid: int = where.pid) -> None:
            end(pid, signal.SIGKILL)

        async def measured(progress: Callable[[object], None] = kill) -> None:
            async with connect_async() as lab:
                await lab.measure(build, "disk", progress=progress)

        with pytest.raises(DaemonError) as gone, connect() as lab:
            asyncio.run(measured()) if asynchronous else lab.measure(build, "disk", progress=kill)
        assert str(gone.value) == f"daemon at {where.events}: it has ended; nobody listens there any more"


def test_a_daemon_that_is_only_busy_is_not_gone(
    start_daemon: Callable[..., Location], build: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_follower, "QUIET", 0.2)
    where, stopped = start_daemon(time_scale=1.0), list[threading.Timer]()

    def stop(_: object) -> None:
        if not stopped:
            os.kill(where.pid, signal.SIGSTOP)
            stopped.append(threading.Timer(2.0, os.kill, (where.pid, signal.SIGCONT)))
            stopped[0].start()

    with connect() as lab:
        assert lab.measure(build, "disk", SweepPlan((Segment(1e6, 6e6, 11),)), progress=stop).sweeps
    stopped[0].join()


@pytest.mark.skipif(sys.platform != "linux", reason="finds the simulator in /proc")
@pytest.mark.parametrize("asynchronous", [False, True])
def test_a_client_waits_for_as_long_as_the_daemon_shows_life_and_says_so(
    start_daemon: Callable[..., Location],
    monkeypatch: pytest.MonkeyPatch,
    caplog: pytest.LogCaptureFixture,
    asynchronous: bool,
) -> None:
    """The bench answers after ten times as long as a silent daemon is waited for."""
    monkeypatch.setattr(protocol, "FIRST_NOTE", 0.3)
    where = start_daemon()
    children = [int(pid) for pid in Path(f"/proc/{where.pid}/task/{where.pid}/children").read_text().split()]

    def ask(conversations: Conversations) -> Conversation[BenchAnswer]:
        request = BenchRequest(id=uuid7(), command={"command": "status"})
        return conversations.answer_to(request, BenchAnswer, patience=0.05)

    async def asked() -> BenchAnswer:
        async with connect_async() as lab:
            await lab.hello()
            return await lab.run(ask(lab.conversations))

    for child in children:
        os.kill(child, signal.SIGSTOP)
    going_on = [threading.Timer(2.0, os.kill, (child, signal.SIGCONT)) for child in children]
    for timer in going_on:
        timer.start()
    with connect() as lab:
        lab.hello()
        answer = asyncio.run(asked()) if asynchronous else lab.run(ask(lab.conversations))
    assert answer.answer["step"] == "disk"
    assert f"daemon at {where.requests}: busy, no answer to `bench` for " in caplog.text
    for timer in going_on:
        timer.join()


def test_a_daemon_that_does_not_answer_the_request_may_have_begun(build: Build) -> None:
    underway = measuring(build, 5.0)
    with pytest.raises(DaemonError) as gone:
        nobody_answers(underway)
    assert str(gone.value) == NO_ANSWER + BIASED


def test_ctrl_c_where_nothing_can_be_cancelled(build: Build) -> None:
    underway = measuring(build, 5.0)
    begin(underway)
    underway.fail(KeyboardInterrupt())
    with pytest.raises(KeyboardInterrupt) as stopped:
        nobody_answers(underway)
    assert stopped.value.__notes__ == [f"the measurement could not be cancelled: {NO_ANSWER}{BIASED}"]


def test_ctrl_c_before_the_answer_cancels_what_has_begun(build: Build) -> None:
    underway = measuring(build, 0.0)
    assert isinstance(underway.step, Ask)
    request = underway.step.frames
    underway.fail(KeyboardInterrupt())
    assert isinstance(underway.step, Ask)
    assert underway.step.frames == request, "which is carried out once only"
    underway.go_on([to_json(MeasureAnswer(id=underway.step.requests[0], measurement="M"))])
    assert isinstance(underway.step, Ask)
    assert b'"cancel"' in underway.step.frames[0]
    assert b'"M"' in underway.step.frames[0]


def test_the_last_words_of_a_daemon_that_has_ended_are_told(start_daemon, end) -> None:
    where = start_daemon()

    def story() -> None:
        with measure._daemon(None, None, (), None, Console(quiet=True)):
            end(where.pid, signal.SIGKILL)  # and not by a request, after which it would go on for a moment
            Path(where.log).write_text("2026-11-29 01:23:29,252 INFO measuring\njournal: no room\n", encoding="utf-8")
            raise DaemonError(GONE)

    with pytest.raises(DaemonError) as gone:
        story()
    assert str(gone.value) == f"{GONE}; its last words: journal: no room"


def test_a_daemon_that_was_killed_has_no_last_words(tmp_path: Path) -> None:
    log = tmp_path / "daemon.log"
    where = Location(1, "", "", "", "", "", None, str(log))
    assert last_words(where, 0.0) == ""
    log.write_text("2026-11-29 01:23:29,252 INFO measuring\n", encoding="utf-8")
    assert last_words(where, 0.0) == ""
    log.write_text("no room\n", encoding="utf-8")
    assert (last_words(where, 0.0), last_words(where, 1e12)) == ("no room", "")
