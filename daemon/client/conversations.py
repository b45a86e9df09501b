"""Conversations with the daemon: the questions, and what needs events as well: measuring, waiting for fits, replays.

`client.Client` has every public method in a blocking form, `async_client.AsyncClient` in an asynchronous one.
"""

import math
import time
import warnings
from asyncio import CancelledError
from collections.abc import Callable, Generator, Sequence
from contextlib import contextmanager
from typing import Any, Unpack

from ...fitters.interface import FitResult
from ...models.build import Build
from ...models.sweep_plan import SweepPlan
from ..files.auto_diagnosis import DIAGNOSIS
from ..wire.events import ProgressEvent, ReceivedEvent, StateEvent
from ..wire.replies import JobAnswer, MissingEvents
from ..wire.requests import DiagnoseRequest, FitRequest, MeasureRequest
from ..wire.uuid7 import uuid7
from .event_follower import EventFollower
from .protocol import Conversation, DaemonError, Deliver, Stream, replay_page
from .questions import MeasureOptions, Questions
from .result_waiter import AnswerWaiter, Measurement, MeasurementWaiter, diagnosis_of, fit_of, require

ASK_AGAIN = 10.0
"""Seconds after which a request is sent again while its result is waited for: one that could not be kept in the
journal is not published, and the repeated request is refused with the reason."""


class MissingEventsWarning(UserWarning):
    """Events that were requested or missed are no longer in the journal."""


def warn_of(missing: MissingEvents) -> None:
    """Issue a warning about events that the journal no longer holds."""
    warnings.warn(missing.sentence, MissingEventsWarning, stacklevel=2)


@contextmanager
def _warning_of_bias(plan: SweepPlan | None) -> Generator[None]:
    """Add to the error of a daemon that has gone that the bias of its measurement may still be on."""
    try:
        yield
    except DaemonError as error:
        if error.code != "unreachable" or plan is None or not plan.bias_V:
            raise
        biased = f"the bias of {plan.bias_V:g} V may still be on: switch it off at the analyzer, or start a daemon"
        raise DaemonError(f"{error}; {biased}, which does it first", error.code) from None


@contextmanager
def _noted_on(stop: BaseException, plan: SweepPlan | None) -> Generator[None]:
    """Add to what stops a measurement that it could not be cancelled, unless it has ended."""
    try:
        with _warning_of_bias(plan):
            yield
    except DaemonError as error:
        if error.code == "unreachable":
            stop.add_note(f"the measurement could not be cancelled: {error}")


class Conversations(Questions):
    """The client's methods, as conversations. All raise DaemonError as the questions do."""

    def listen(
        self, patience: float = math.inf, missing: Callable[[MissingEvents], None] = warn_of
    ) -> Stream[ReceivedEvent | None]:
        """Deliver every event from this call on, in order, until none comes within `patience` seconds.

        Events that were missed while the caller was slow or the connection was down are requested again; `missing` is
        called with the range of those that the journal no longer holds. Each listener has its own subscription.
        """
        follower = yield from self._follow(survives_restart=True)
        yield Deliver(None)  # tells the caller that the subscription is open
        while (received := (yield from follower.receive(patience))) is not None:
            if isinstance(received, MissingEvents):
                missing(received)
            else:
                yield Deliver(received)

    def replay(
        self, since: int, until: int | None = None, missing: Callable[[MissingEvents], None] = warn_of
    ) -> Stream[ReceivedEvent]:
        """Deliver the events `since` .. `until` (both included; None: up to the newest) from the journal, in order.

        For those that the journal no longer holds, `missing` is called at their place with their range and the reason.
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
        **options: Unpack[MeasureOptions],
    ) -> Conversation[Measurement]:
        """Measure a step of a build and wait for the end; Ctrl-C or cancelling the task cancels the measurement.

        Without `plan`, the build's own plan is used. Options: a higher `priority` (-10 .. 10) goes first; `lease` is
        needed while the instrument is leased; `decides` is the id of the measurement whose diagnosis this one helps to
        decide; `analyzer` is the name of one of the daemon's analyzers, by default the first one that this client may
        use. Raises DaemonError with the daemon's sentence if the measurement failed or was cancelled.
        """
        follower = yield from self._follow()
        request = MeasureRequest(id=uuid7(), build=build, step=step, plan=plan, **options)
        measurement: str | None = None
        with _warning_of_bias(plan or build.plan):
            try:
                measurement = yield from self.begun(request)
                waiter = MeasurementWaiter(measurement, progress)
                while (measured := waiter.measurement) is None:
                    if (received := (yield from follower.receive(ASK_AGAIN))) is None:
                        yield from self.begun(request)  # which is carried out only once
                    else:
                        waiter.take(received)
            except (KeyboardInterrupt, CancelledError) as stop:
                with _noted_on(stop, plan or build.plan):
                    # Where the answer was not awaited, the same request is answered with the id of its measurement.
                    yield from self.cancel(measurement or (yield from self.begun(request)))
                raise
        return measured

    def wait_fit(self, fitter: str, measurement: str, patience: float = 120.0) -> Conversation[FitResult]:
        """Return the fit of a measurement by a fitter that the daemon keeps running; wait up to `patience` seconds.

        Raises FitError if the fitter refused, DaemonError if it does not run or does not answer in time.
        """
        follower = yield from self._follow()
        waiter = AnswerWaiter(measurement, fitter)
        waiter.take(*(yield from self.fits(measurement)))
        if waiter.answer is None:
            require(fitter, (yield from self.status()).fitters)
        return fit_of((yield from self._wait(waiter, follower, patience, kept=True)))

    def fit(self, measurement: str, fitter: str, patience: float = 600.0) -> Conversation[FitResult]:
        """Return the fit of a measurement by any fitter installed with the daemon; request it if there is none yet.

        Raises FitError if the fitter refused, DaemonError if it is not installed or does not answer within `patience`
        seconds.
        """
        follower = yield from self._follow()
        waiter = AnswerWaiter(measurement, fitter)
        waiter.take(*(yield from self.fits(measurement)))
        waiter.forget_given_up()
        request = FitRequest(id=uuid7(), measurement=measurement, fitter=fitter)
        if waiter.answer is None:
            yield from self.answer_to(request, JobAnswer)
        return fit_of((yield from self._wait(waiter, follower, patience, requested=request)))

    def diagnose(
        self,
        measurement: str,
        effects: Sequence[str] | None = None,
        patience: float = 1200.0,
        *,
        also: Sequence[str] = (),
        propose: bool = False,
    ) -> Conversation[dict[str, Any]]:
        """Request the diagnosis of a measurement; return the object that `pzctl diagnose --json` prints.

        `also` are the ids of further measurements made to decide it. With `propose`, `would_measure` in the result
        lists the sweeps that would decide what is open. Raises FitError if it cannot be diagnosed, DaemonError if an
        effect is not known or no answer comes within `patience` seconds.
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
        return diagnosis_of((yield from self._wait(waiter, follower, patience, requested=request)))

    def wait_diagnosis(self, measurement: str, patience: float = 300.0) -> Conversation[dict[str, Any]]:
        """Return the diagnosis that the daemon makes of a measurement by itself; wait up to `patience` seconds.

        Raises FitError if it cannot be diagnosed, DaemonError if no answer comes in time.
        """
        follower = yield from self._follow()
        waiter = AnswerWaiter(measurement, DIAGNOSIS)
        waiter.take(*(yield from self.fits(measurement)))
        return diagnosis_of((yield from self._wait(waiter, follower, patience)))

    def _follow(self, *, survives_restart: bool = False) -> Conversation[EventFollower]:
        """Subscribe to the events. Do this before sending a request, so that no event about it is missed."""
        follower = EventFollower(self._events, self._requests, survives_restart=survives_restart)
        yield from follower.open()
        return follower

    def _look_up(self, waiter: AnswerWaiter) -> Conversation[None]:
        """Look for the answer in the journal. Raises DaemonError if the journal could not keep it."""
        answers, not_kept = yield from self.answers(waiter.measurement)
        waiter.take(*answers)
        if waiter.answer is None and waiter.fitter in not_kept:
            raise DaemonError(not_kept[waiter.fitter], "journal")

    def _wait(
        self,
        waiter: AnswerWaiter,
        follower: EventFollower,
        patience: float,
        *,
        kept: bool = False,
        requested: FitRequest | DiagnoseRequest | None = None,
    ) -> Conversation[ReceivedEvent]:
        """Return the answer, listening until it comes. Raises DaemonError if none comes in time.

        Also raises DaemonError once the journal cannot keep the answer, or once the daemon no longer keeps the fitter
        running though it has to (`kept`).
        """
        deadline = time.monotonic() + patience
        ask_at = time.monotonic() + ASK_AGAIN
        while (answer := waiter.answer) is None:
            if time.monotonic() >= ask_at:
                if requested is not None:
                    yield from self.answer_to(requested, JobAnswer)  # which is carried out only once
                else:
                    yield from self._look_up(waiter)
                ask_at = time.monotonic() + ASK_AGAIN
                continue
            received = yield from follower.receive(max(0.0, min(deadline, ask_at) - time.monotonic()))
            if received is None:
                if time.monotonic() < deadline:
                    continue
                raise DaemonError(f"fitter {waiter.fitter!r}: no answer within {patience:g} s", "no-answer")
            if isinstance(received, MissingEvents):  # the missed events may include the answer: request it
                waiter.take(*(yield from self.fits(waiter.measurement)))
                continue
            waiter.take(received)
            event = received.event
            if kept and isinstance(event, StateEvent) and (event.fitter == waiter.fitter or event.state == "started"):
                require(waiter.fitter, (yield from self.status()).fitters)
        return answer
