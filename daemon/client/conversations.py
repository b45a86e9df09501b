"""All that a client can do: the questions, and what takes listening as well - measuring, waiting for answers, replays.

Every public method is a method of `client.Client`, which blocks, and of `async_client.AsyncClient`, which is awaited.
"""

import math
import time
import warnings
from asyncio import CancelledError
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

from ...fitters.interface import FitResult
from ...models.build import Build
from ...models.sweep_plan import SweepPlan
from ..files.auto_diagnosis import DIAGNOSIS
from ..wire.events import ProgressEvent, ReceivedEvent, StateEvent
from ..wire.replies import JobAnswer, MissingEvents
from ..wire.requests import DiagnoseRequest, FitRequest
from ..wire.uuid7 import uuid7
from .event_follower import EventFollower
from .protocol import Conversation, DaemonError, Deliver, Stream, replay_page
from .questions import Questions
from .result_waiter import AnswerWaiter, Measurement, MeasurementWaiter, diagnosis_of, fit_of, require


class MissingEventsWarning(UserWarning):
    """Events that were asked for, or missed, and that the journal no longer holds."""


def warn_of(missing: MissingEvents) -> None:
    """Warn, in one sentence, of events that the journal no longer holds."""
    warnings.warn(missing.sentence, MissingEventsWarning, stacklevel=2)


class Conversations(Questions):
    """What a client can do, as conversations. All raise DaemonError as the questions do."""

    def listen(
        self, patience: float = math.inf, missing: Callable[[MissingEvents], None] = warn_of
    ) -> Stream[ReceivedEvent | None]:
        """Give every event from this call on, in order, none lost, until none comes within `patience` seconds.

        What came while the caller was slow, or the daemon was away, is asked for again; `missing` is told which of it
        the journal no longer holds. Each listener has a subscription of its own.
        """
        follower = yield from self._follow()
        yield Deliver(None)  # the caller goes on once the subscription is open
        while (heard := (yield from follower.receive(patience))) is not None:
            if isinstance(heard, MissingEvents):
                missing(heard)
            else:
                yield Deliver(heard)

    def replay(
        self, since: int, until: int | None = None, missing: Callable[[MissingEvents], None] = warn_of
    ) -> Stream[ReceivedEvent]:
        """Give the events `since` .. `until` (both included, None: the newest) from the journal, in order.

        `missing` is told which of them the journal no longer holds, and why, when their turn comes.
        """
        begin: int | None = since
        while begin is not None:
            page = yield from replay_page(self._requests, begin, until)
            for item in page.items:
                if isinstance(item, MissingEvents):
                    missing(item)
                else:
                    yield Deliver(item)
            begin = page.next

    def measure(
        self,
        build: Build,
        step: str,
        plan: SweepPlan | None = None,
        progress: Callable[[ProgressEvent], None] = lambda _: None,
        *,
        priority: int = 0,
        lease: str | None = None,
        decides: str | None = None,
    ) -> Conversation[Measurement]:
        """Measure a step of a build and wait for it; who stops waiting (Ctrl-C, a cancelled task) cancels it.

        `plan` is the build's own where none is given; a higher `priority` (-10 .. 10) goes first; `lease` is needed
        while the instrument is leased; `decides` is the measurement whose diagnosis it is to decide. Raises
        DaemonError with the daemon's sentence where the measurement failed or was cancelled.
        """
        follower = yield from self._follow()
        measurement = yield from self.begin(build, step, plan, priority=priority, lease=lease, decides=decides)
        waiter = MeasurementWaiter(measurement, progress)
        try:
            while (measured := waiter.measurement) is None:
                waiter.take((yield from follower.receive(math.inf)))
        except (KeyboardInterrupt, CancelledError):
            with suppress(DaemonError):  # it may have ended by itself in the meantime
                yield from self.cancel(measurement)
            raise
        return measured

    def wait_fit(self, fitter: str, measurement: str, patience: float = 120.0) -> Conversation[FitResult]:
        """Return what a fitter that the daemon keeps answered to a measurement, waiting for it.

        Raises FitError where the fitter refused, DaemonError where it does not run or does not answer in time.
        """
        follower = yield from self._follow()
        waiter = AnswerWaiter(measurement, fitter)
        waiter.take(*(yield from self.fits(measurement)))
        if waiter.answer is None:
            require(fitter, (yield from self.status()).fitters)
        return fit_of((yield from self._wait(waiter, follower, patience, kept=True)))

    def fit(self, measurement: str, fitter: str, patience: float = 600.0) -> Conversation[FitResult]:
        """Have a measurement fitted by any fitter that is installed beside the daemon, unless it was already.

        Raises FitError where the fitter refused, DaemonError where it is not installed or does not answer in time.
        """
        follower = yield from self._follow()
        waiter = AnswerWaiter(measurement, fitter)
        waiter.take(*(yield from self.fits(measurement)))
        waiter.forget_given_up()
        if waiter.answer is None:
            yield from self.answer_to(FitRequest(id=uuid7(), measurement=measurement, fitter=fitter), JobAnswer)
        return fit_of((yield from self._wait(waiter, follower, patience)))

    def diagnose(
        self,
        measurement: str,
        effects: Sequence[str] | None = None,
        patience: float = 1200.0,
        *,
        also: Sequence[str] = (),
        propose: bool = False,
    ) -> Conversation[dict[str, Any]]:
        """Have a measurement diagnosed; return the object that `pzctl diagnose --json` prints.

        `also` are measurements that were made to decide it; `propose` asks which measurements would decide what stays
        open: they are `would_measure` in what is returned. Raises FitError where it cannot be, DaemonError where an
        effect is not known or no answer comes in time.
        """
        follower = yield from self._follow()
        request = DiagnoseRequest(
            id=uuid7(),
            measurement=measurement,
            effects=tuple(effects) if effects else None,
            also=tuple(also),
            propose=propose,
        )
        job = yield from self.answer_to(request, JobAnswer)
        waiter = AnswerWaiter(measurement, job.fitter, job.version)
        waiter.take(*(yield from self.fits(measurement)))
        waiter.forget_given_up()
        return diagnosis_of((yield from self._wait(waiter, follower, patience)))

    def wait_diagnosis(self, measurement: str, patience: float = 300.0) -> Conversation[dict[str, Any]]:
        """Return the diagnosis of a measurement that the daemon makes by itself, waiting for it.

        Raises FitError where it cannot be diagnosed, DaemonError where no answer comes in time.
        """
        follower = yield from self._follow()
        waiter = AnswerWaiter(measurement, DIAGNOSIS)
        waiter.take(*(yield from self.fits(measurement)))
        return diagnosis_of((yield from self._wait(waiter, follower, patience)))

    def _follow(self) -> Conversation[EventFollower]:
        """Subscribe. This comes before anything is asked for: what is said meanwhile is heard."""
        follower = EventFollower(self._events, self._requests)
        yield from follower.open()
        return follower

    def _wait(
        self, waiter: AnswerWaiter, follower: EventFollower, patience: float, *, kept: bool = False
    ) -> Conversation[ReceivedEvent]:
        """Listen until there is an answer. Raises DaemonError where none comes in time.

        Where the daemon has to keep the fitter (`kept`), also as soon as it does no longer.
        """
        deadline = time.monotonic() + patience
        while (answer := waiter.answer) is None:
            heard = yield from follower.receive(max(0.0, deadline - time.monotonic()))
            if heard is None:
                raise DaemonError(f"fitter {waiter.fitter!r}: no answer within {patience:g} s", "no-answer")
            if isinstance(heard, MissingEvents):  # the answer may be among what was missed, and still be known
                waiter.take(*(yield from self.fits(waiter.measurement)))
                continue
            waiter.take(heard)
            event = heard.event
            if kept and isinstance(event, StateEvent) and (event.fitter == waiter.fitter or event.state == "started"):
                require(waiter.fitter, (yield from self.status()).fitters)
        return answer
