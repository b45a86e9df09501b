"""An event that a client cannot read is a gap with a reason: listening, replaying and measuring go on."""

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from pzctl import connect
from pzctl.daemon.client.client import Client
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal import journal_writer
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.wire import events as wire
from pzctl.daemon.wire.events import StateEvent
from pzctl.daemon.wire.replies import Answer, MissingEvents
from pzctl.daemon.wire.requests import LONGEST_ERROR, SubmitRequest
from pzctl.models.build import Build


def test_a_replay_goes_on_behind_an_event_that_cannot_be_read(
    start_daemon: Callable[..., object], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def damaged(event: wire.Event, payload: wire.Payload = ()) -> list[bytes]:
        topic, header, *columns = wire.encode(event, payload)
        return [topic, header.replace(b'"says":"damaged"', b'"says":["damaged"]'), *columns]

    monkeypatch.setattr(journal_writer, "encode", damaged)
    with closing(JournalWriter(journal_folder(tmp_path))) as journal:
        for says in ("one", "damaged", "three"):
            journal.append(StateEvent(state="bench", says=says))
    monkeypatch.undo()
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    start_daemon()
    gaps: list[MissingEvents] = []
    with connect() as lab:
        events = [heard.event for heard in lab.replay(1, 3, missing=gaps.append)]
    assert [event.seq for event in events] == [1, 3]
    assert [gap.sentence.partition(": message: the header is not valid:")[0] for gap in gaps] == [
        "event 2 cannot be read"
    ]


def test_a_listener_hears_what_follows_and_a_measurement_ends(
    start_daemon: Callable[..., object], build: Build, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What a fitter says of the first measurement is longer than the headers that this client reads."""
    start_daemon()
    with connect() as lab:
        first = lab.measure(build, "disk")
        gaps: list[MissingEvents] = []
        listener = lab.listen(20, missing=gaps.append)
        sweeps = [sweep.id for sweep in first.sweeps]
        monkeypatch.setattr(wire, "LARGEST_FRAME", 20_000)
        lab.submit_diagnosis(first.id, sweeps, "mine", "1", {"says": ["x" * 30_000]})
        lab.bench({"command": "status"})
        assert isinstance(next(listener).event, StateEvent)
        (gap,) = gaps
        assert "cannot be read: message: header of" in gap.sentence
        assert lab.measure(build, "disk").sweeps


def test_a_submission_says_no_more_than_a_reader_takes(start_daemon: Callable[..., object], build: Build) -> None:
    start_daemon()
    with connect() as lab:
        measured = lab.measure(build, "disk")
        sweeps = [sweep.id for sweep in measured.sweeps]
        longest = "x" * (LONGEST_ERROR + 1000)
        lab.submit(measured.id, sweeps, "mine", "1", longest)
        (fit,) = [one.event for one in lab.fits(measured.id) if isinstance(one.event, wire.FitEvent)]
        assert fit.error == longest[:LONGEST_ERROR]
        for words, says in (
            ({"error": longest}, r"Expected `str` of length <= 4000 - at `\$.error`"),
            ({"version": longest, "error": "none"}, "version has 5000 characters; at most 4000 are allowed"),
        ):
            with pytest.raises(DaemonError, match=says):
                submit(lab, measured.id, sweeps, **words)


def submit(lab: Client, measurement: str, sweeps: list[str], version: str = "1", error: str = "") -> None:
    """Submit an error as another client would, which shortens nothing."""
    request = SubmitRequest(
        id=f"{len(version)} {len(error)}", measurement=measurement, sweeps=tuple(sweeps), fitter="mine",
        version=version, error=error,
    )  # fmt: skip
    lab.run(lab.conversations.answer_to(request, Answer))
