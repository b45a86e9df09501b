"""The client for asyncio programs: the same questions as `client.Client`, each awaited, many at a time.

async with connect_async() as lab:
    measurement = await lab.measure(build, "disk")
    result = await lab.wait_fit("mason", measurement.id)
"""

import asyncio
from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import asynccontextmanager, suppress
from pathlib import Path
from typing import Any

import zmq.asyncio

from ...fitters.interface import FitResult
from ...models.build import Build
from ...models.sweep_plan import SweepPlan
from ..wire import replies as reply
from ..wire import requests as ask
from ..wire.curve_keys import ClientKey
from ..wire.events import ProgressEvent, ReceivedEvent
from ..wire.uuid7 import uuid7
from .async_connection import AsyncRequestClient, AsyncSubscription
from .client import BENCH_PATIENCE
from .connection import LOOKS, DaemonError
from .location import address
from .result_waiter import Answers, Measurement, MeasurementWaiter, diagnosis_of, fit_of, require


@asynccontextmanager
async def connect_async(
    events: str | None = None, requests: str | None = None, key: str | Path | None = None
) -> "AsyncGenerator[AsyncClient]":
    """Give a client of the daemon at these endpoints, or of the one that runs here; as `client.connect`.

    Raises DaemonError where none runs, KeyFileError where the key cannot be used.
    """
    events, requests, own = address(events, requests, key)
    context = zmq.asyncio.Context()
    asker = AsyncRequestClient(context, requests, own)
    try:
        yield AsyncClient(context, events, asker, own)
    finally:
        await asker.close()
        context.term()


class AsyncClient:
    """A connection to a daemon, for one event loop.

    Every method raises DaemonError where the daemon refuses, does not answer, or has gone.
    """

    def __init__(
        self, context: zmq.asyncio.Context, events: str, asker: AsyncRequestClient, key: ClientKey | None
    ) -> None:
        self._context = context
        self._endpoint = events
        self._asker = asker
        self._key = key

    async def hello(self) -> reply.HelloAnswer:
        """Ask who is there."""
        return await self._asker.ask(ask.HelloRequest(id=uuid7()), reply.HelloAnswer)

    async def status(self) -> reply.StatusAnswer:
        """Ask what is going on."""
        return await self._asker.ask(ask.StatusRequest(id=uuid7()), reply.StatusAnswer)

    async def metrics(self) -> reply.MetricsAnswer:
        """Ask what was counted and timed since the daemon began."""
        return await self._asker.ask(ask.MetricsRequest(id=uuid7()), reply.MetricsAnswer)

    async def settings(self) -> dict[str, Any]:
        """Ask how the daemon was started."""
        return (await self._asker.ask(ask.SettingsRequest(id=uuid7()), reply.SettingsAnswer)).settings

    async def samples(self, name: str | None = None) -> tuple[reply.SampleHistory, ...]:
        """Return what was measured, by sample; only of sample `name` where one is given."""
        return (await self._asker.ask(ask.SamplesRequest(id=uuid7(), name=name), reply.SamplesAnswer, LOOKS)).samples

    async def sweeps(self, measurement: str) -> tuple[ReceivedEvent, ...]:
        """Return the sweep events of a measurement, after those of the latest one of each earlier step."""
        return tuple((await self._asker.events(ask.SweepsRequest(id=uuid7(), measurement=measurement)))[0])

    async def fits(self, measurement: str) -> tuple[ReceivedEvent, ...]:
        """Return what the fitters answered to a measurement: fit and diagnosis events."""
        return tuple((await self._asker.events(ask.FitsRequest(id=uuid7(), measurement=measurement)))[0])

    async def bench(self, command: dict[str, Any]) -> dict[str, Any]:
        """Give the simulator's bench a command; return what it answers."""
        request = ask.BenchRequest(id=uuid7(), command=command)
        return (await self._asker.ask(request, reply.BenchAnswer, BENCH_PATIENCE)).answer

    async def begin(
        self, build: Build, step: str, plan: SweepPlan | None = None, *, priority: int = 0, lease: str | None = None
    ) -> str:
        """Ask for a measurement and do not wait for it; return its id."""
        request = ask.MeasureRequest(id=uuid7(), build=build, step=step, plan=plan, priority=priority, lease=lease)
        return (await self._asker.ask(request, reply.MeasureAnswer)).measurement

    async def cancel(self, measurement: str | None = None) -> None:
        """Cancel a measurement; the running one where none is named."""
        await self._asker.ask(ask.CancelRequest(id=uuid7(), measurement=measurement), reply.Answer)

    @asynccontextmanager
    async def lease(self, owner: str, seconds: float = 60.0) -> AsyncGenerator[str]:
        """Have the instrument to oneself; give the id that `measure` needs meanwhile. Expires after `seconds`.

        Raises DaemonError where it is leased to another one already (code `leased`) or measures (code `busy`).
        """
        request = ask.LeaseRequest(id=uuid7(), owner=owner, seconds=seconds)
        held = (await self._asker.ask(request, reply.LeaseAnswer)).lease
        try:
            yield held
        finally:
            with suppress(DaemonError):  # it may have expired
                await self._asker.ask(ask.ReleaseRequest(id=uuid7(), lease=held), reply.Answer)

    async def shutdown(self) -> None:
        """End the daemon; what runs is cancelled, the bias is off, the instrument let go of."""
        await self._asker.ask(ask.ShutdownRequest(id=uuid7()), reply.Answer)

    async def listen(self) -> AsyncGenerator[ReceivedEvent]:
        """Yield every event from the first step on, in order, none lost; each listener has a socket of its own."""
        async with self._subscribed() as subscription:
            while True:
                yield await subscription.receive()

    async def replay(self, since: int, until: int | None = None) -> AsyncGenerator[ReceivedEvent]:
        """Yield the events `since` .. `until` (both included, None: the newest) from the journal, in order."""
        more = True
        while more:
            heard, more = await self._asker.events(ask.ReplayRequest(id=uuid7(), since=since, until=until))
            for one in heard:
                yield one
            since = heard[-1].event.seq + 1 if heard else since

    async def measure(
        self,
        build: Build,
        step: str,
        plan: SweepPlan | None = None,
        progress: Callable[[ProgressEvent], None] = lambda _: None,
        *,
        priority: int = 0,
        lease: str | None = None,
    ) -> Measurement:
        """Measure a step of a build and wait for it; where the waiting is cancelled, so is the measurement.

        `plan` is the build's own where none is given; a higher `priority` (-10 .. 10) goes first; `lease` is needed
        while the instrument is leased. Raises DaemonError with the daemon's sentence where the measurement failed or
        was cancelled.
        """
        async with self._subscribed() as subscription:
            measurement = await self.begin(build, step, plan, priority=priority, lease=lease)
            try:
                return await _followed(subscription, measurement, progress)
            except asyncio.CancelledError:
                with suppress(DaemonError):  # it may have ended by itself in the meantime
                    await self.cancel(measurement)
                raise

    async def wait_fit(self, fitter: str, measurement: str, patience: float = 120.0) -> FitResult:
        """Return what a fitter that the daemon keeps answered to a measurement, waiting for it.

        Raises FitError where the fitter refused, DaemonError where it does not run or does not answer in time.
        """
        async with self._subscribed() as subscription:
            answers = await self._answers(measurement)
            if answers.find(measurement, fitter) is None:
                require(fitter, (await self.status()).fitters)
            return fit_of(await _answer(subscription, answers, (measurement, fitter, None), patience))

    async def fit(self, measurement: str, fitter: str, patience: float = 600.0) -> FitResult:
        """Have a measurement fitted by any fitter that is installed beside the daemon, unless it was already.

        Raises FitError where the fitter refused, DaemonError where it is not installed or does not answer in time.
        """
        async with self._subscribed() as subscription:
            answers = await self._answers(measurement)
            answers.forget_given_up(measurement, fitter)
            if answers.find(measurement, fitter) is None:
                await self._asker.ask(
                    ask.FitRequest(id=uuid7(), measurement=measurement, fitter=fitter), reply.JobAnswer
                )
            return fit_of(await _answer(subscription, answers, (measurement, fitter, None), patience))

    async def diagnose(
        self, measurement: str, effects: Sequence[str] | None = None, patience: float = 1200.0
    ) -> dict[str, Any]:
        """Have a measurement diagnosed; return the object that `pzctl diagnose --json` prints.

        Raises FitError where it cannot be, DaemonError where an effect is not known or no answer comes in time.
        """
        request = ask.DiagnoseRequest(id=uuid7(), measurement=measurement, effects=tuple(effects) if effects else None)
        async with self._subscribed() as subscription:
            wanted = await self._asker.ask(request, reply.JobAnswer)
            answers = await self._answers(measurement)
            answers.forget_given_up(measurement, wanted.fitter)
            key = (measurement, wanted.fitter, wanted.version)
            return diagnosis_of(await _answer(subscription, answers, key, patience))

    async def _answers(self, measurement: str) -> Answers:
        answers = Answers()
        answers.note(await self.fits(measurement))
        return answers

    @asynccontextmanager
    async def _subscribed(self) -> AsyncGenerator[AsyncSubscription]:
        subscription = AsyncSubscription(self._context, self._endpoint, self._asker, self._key)
        try:
            await subscription.open()
            yield subscription
        finally:
            subscription.close()


async def _followed(
    subscription: AsyncSubscription, measurement: str, progress: Callable[[ProgressEvent], None]
) -> Measurement:
    """Listen until a measurement has ended. Raises DaemonError where it ended without sweeps."""
    following = MeasurementWaiter(measurement, progress)
    while (found := following.take(await subscription.receive())) is None:
        pass
    return found


async def _answer(
    subscription: AsyncSubscription, answers: Answers, key: tuple[str, str, str | None], patience: float
) -> ReceivedEvent:
    """Listen until there is an answer under this key, or one in the fitter's place. Raises DaemonError."""
    measurement, fitter, _ = key
    try:
        async with asyncio.timeout(patience):
            while (found := answers.find(*key) or answers.find(measurement, fitter, "")) is None:
                answers.note([await subscription.receive()])
            return found
    except TimeoutError:
        raise DaemonError(f"fitter {fitter!r}: no answer within {patience:g} s", "no-answer") from None
