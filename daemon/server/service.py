"""The daemon: owns the analyzer and the journal, answers requests, publishes what happened.

One asyncio loop owns the journal and answers requests, one thread owns the analyzer, one the events socket, each
fitter is a process.
"""

import asyncio
import gc
import logging
import os
import signal
import sys
from collections.abc import Callable
from contextlib import AsyncExitStack, ExitStack
from dataclasses import asdict, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import zmq
import zmq.asyncio

from ...drivers import open_analyzer as open_visa
from ...drivers.base.analyzer import Analyzer
from ...models.sweep import now_utc
from ...models.sweep_plan import LevelLimits
from ..client.location import Location, announce, withdraw
from ..files.auto_diagnosis import DIAGNOSIS, is_significant
from ..files.daemon_options import DaemonOptions
from ..files.database_url import without_password
from ..files.paths import compensation_file, journal_folder, keys_folder, log_file, unsaved_folder, writable_home
from ..files.worker_limits import allow_many_files
from ..journal.journal_writer import JournalWriter
from ..wire.curve_keys import LOCAL
from ..wire.events import BeatEvent, Event, FitEvent, InstrumentInfo, StateEvent, encode
from ..wire.metrics import Metrics
from ..wire.replies import FitterState
from .access.access_control import AccessControl
from .access.connection_guard import LARGEST_MESSAGE, MOST_SUBSCRIBED, ConnectionGuard
from .acquisition import Acquisition, AnalyzerThread
from .compensation_check import CompensationCheck
from .plan_limits import PlanLimits
from .publishing.durable_publisher import DurablePublisher
from .publishing.event_publisher import EventPublisher
from .publishing.spool import Spool
from .requests.request_handlers import RequestHandlers
from .requests.request_server import RequestServer
from .simulated_analyzer import simulated_instrument
from .sockets import bind_events, bind_requests, from_here, gate_for, port_of
from .workers.job_runner import JobRunner, WorkerJob
from .workers.pending_results import PendingResults
from .workers.supervisor import Supervisor, WorkerExit
from .workers.visitors import Visitors

log = logging.getLogger(__name__)

BEAT = 1.0
"""Seconds between two life signs."""

SIMULATED_SECONDS = 30.0
"""How long an answer of the daemon's own simulated instrument may take: it is there, but the machine may be busy."""

DEATHS = 2
"""How often a fitter may die over a measurement before its answer is that it cannot."""


def run(options: DaemonOptions) -> None:
    """Run a daemon on the user's data folder until it is told to end (SIGTERM, SIGINT, or a request).

    Raises FolderError, EndpointError, JournalError or InstrumentError where it cannot start, JournalError where the
    disk fails.
    """
    folder = writable_home()
    open_analyzer: Callable[[str], Analyzer] = open_visa
    with ExitStack() as stack, asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
        if options.resource is None:
            open_analyzer = partial(open_visa, timeout_seconds=SIMULATED_SECONDS)
            simulated = stack.enter_context(simulated_instrument(log_file(folder, "sim"), options.simulator))
            options = replace(options, resource=simulated.instrument, bench=simulated.bench)
        runner.run(_serve(folder, options, open_analyzer))


async def _serve(folder: Path, options: DaemonOptions, open_analyzer: Callable[[str], Analyzer]) -> None:
    """Open everything, serve, and close everything in the opposite order, whatever happens."""
    resource = options.resource or ""
    async with AsyncExitStack() as stack:
        journal = JournalWriter(journal_folder(folder), options.journal, options.station)
        stack.callback(journal.close)  # last of all: its lock keeps the next daemon out until all is let go of
        withdraw(folder)  # what a killed daemon left
        stack.callback(withdraw, folder)
        context = zmq.asyncio.Context()
        stack.callback(context.term)
        gate = gate_for((options.events, options.requests), keys_folder(folder))
        stack.callback(gate.start(context).stop)
        allow_many_files()
        plain: zmq.Context[zmq.Socket[bytes]] = zmq.Context(shadow=context)
        events, heard_at = bind_events(plain, options.events, gate)
        stack.callback(events.close)
        requests, asked_at = bind_requests(context, options.requests, gate)
        stack.callback(requests.close)
        metrics = Metrics()
        most = {port_of(heard_at): MOST_SUBSCRIBED, port_of(asked_at): LARGEST_MESSAGE}
        intake = ConnectionGuard(most, metrics.counts)
        voice = EventPublisher(plain, events)
        stack.callback(voice.close, lambda: intake.cut(port_of(heard_at), "the daemon ends"))
        analyzer = AnalyzerThread(resource, open_analyzer)
        stack.push_async_callback(analyzer.close)
        identity = await analyzer.identify()
        instrument = InstrumentInfo(**asdict(identity), simulated=options.bench is not None)
        endpoints = (heard_at, asked_at)
        daemon = Daemon(
            journal, voice, requests, intake, metrics, analyzer, instrument, options, folder, endpoints, gate
        )
        where = Location(
            pid=os.getpid(),
            run=journal.run,
            version=version("pzctl"),
            events=from_here(heard_at),
            requests=from_here(asked_at),
            resource=resource,
            bench=options.bench,
            log=str(log_file(folder, "daemon")),
            journal=options.journal,
            station=options.station,
            key=gate.local,
        )
        announce(folder, where)
        log.info("%s at %s; requests %s, events %s; data %s", instrument.idn, resource, asked_at, heard_at, folder)
        await daemon.serve()


class Daemon:
    """The parts of a daemon, and what ties them together."""

    def __init__(
        self,
        journal: JournalWriter,
        voice: EventPublisher,
        requests: zmq.asyncio.Socket,
        intake: ConnectionGuard,
        metrics: Metrics,
        analyzer: AnalyzerThread,
        instrument: InstrumentInfo,
        options: DaemonOptions,
        folder: Path,
        endpoints: tuple[str, str],
        gate: AccessControl,
    ) -> None:
        self._journal = journal
        self._voice = voice
        self._intake = intake
        self._heard_at = port_of(endpoints[0])
        self._gate = gate
        self._options = options
        self._folder = folder
        self._stop = asyncio.Event()
        self._deaths: dict[tuple[str, str], int] = {}
        around = (folder, from_here(endpoints[0]), from_here(endpoints[1]), gate.local)
        self._metrics = metrics
        self._publisher = DurablePublisher(journal, Spool(unsaved_folder(folder)), self._metrics, voice.say, self._said)
        self.publish = self._publisher.publish
        check = CompensationCheck(compensation_file(folder), options.compensation_days)
        self._acquisition = Acquisition(analyzer, instrument, self.publish, self._publisher.there, check)
        self._ledger = PendingResults(options.fitters)
        self._supervisor = Supervisor(
            *around,
            limits=options.limits,
            ledger=self._ledger,
            changed=self._fitter_changed,
            died=self._fitter_died,
            visitors=Visitors((*options.fitters, DIAGNOSIS)),
        )
        self._errands = JobRunner(*around, options.limits, lambda event: self.publish(event, ()))
        desk = RequestHandlers(
            journal=journal,
            acquisition=self._acquisition,
            supervisor=self._supervisor,
            errands=self._errands,
            instrument=instrument,
            endpoints=endpoints,
            bench=options.bench,
            settings=asdict(options) | {"journal": options.journal and without_password(options.journal)},
            publish=self.publish,
            shutdown=self._end,
            metrics=self._metrics,
            plan_limits=PlanLimits(LevelLimits(options.max_bias_V, options.max_oscillator_V)),
        )
        self._reception = RequestServer(requests, desk, gate, intake)

    def _said(self, event: Event) -> None:
        """Take note of what was said."""
        self._metrics.note(event)
        self._ledger.note(event)
        if isinstance(event, FitEvent):
            self._follow_up(event)
        if isinstance(event, StateEvent):
            log.info("%s %s %s", event.state, event.measurement or event.fitter or "", event.says)

    def _follow_up(self, fit: FitEvent) -> None:
        """Have a fit that leaves a mismatch diagnosed, once for each measurement, in the background."""
        report = fit.report
        if report is None or not is_significant(report.chi2_per_dof, fit.fitter, asdict(self._options)):
            return
        known = self._journal.measurement(fit.measurement)
        if known is not None and not self._journal.answers(known.id, DIAGNOSIS):
            self._errands.begin(WorkerJob(known.id, None), known, self._journal.sweep_ids(known.id))

    async def serve(self) -> None:
        """Serve until told to end. Raises JournalError where the journal fails."""
        _on_signals(self._end)
        self._publisher.catch_up()
        self.publish(StateEvent(state="started", says=_limits(self._options), client=LOCAL), ())
        for left in self._journal.unfinished():
            says = "the daemon ended before this measurement did; measure again"
            self.publish(StateEvent(state="abandoned", says=says, measurement=left.id, sample=left.sample), ())
        gc.collect()
        gc.freeze()  # what is there now stays: to look through it again and again would hold up answers
        acquiring = asyncio.create_task(self._acquisition.work())
        others = [self._reception.serve(), self._intake.watch(), self._publisher.mend(), self._beat()]
        others += [self._supervisor.keep(name) for name in self._options.fitters]
        tasks = [acquiring, *map(asyncio.create_task, others)]
        stop = asyncio.create_task(self._stop.wait())
        try:
            await self._until_stopped(stop, acquiring, {*tasks})
        finally:
            self._acquisition.cancel_all()
            await self._errands.end()
            for task in (*tasks, stop):
                task.cancel()
            await asyncio.wait((*tasks, stop))

    def _end(self) -> None:
        """Begin to end; from now on nobody should find this daemon."""
        withdraw(self._folder)
        self._stop.set()

    async def _until_stopped(
        self, stop: "asyncio.Task[Any]", acquiring: "asyncio.Task[None]", tasks: "set[asyncio.Task[None]]"
    ) -> None:
        """Wait until told to end; then let the running measurement come to its end. A task that failed raises."""
        while not stop.done():
            done, _ = await asyncio.wait({stop, *tasks}, return_when=asyncio.FIRST_COMPLETED)
            for task in done & tasks:
                task.result()  # a fitter that is broken is done; anything else that is done has failed
                tasks.discard(task)
        self.publish(StateEvent(state="stopping"), ())
        self._acquisition.cancel_all()
        waiting = self._acquisition.waiting
        while not acquiring.done() and (self._acquisition.current or (waiting and not self._publisher.is_away)):
            await asyncio.sleep(0.02)

    async def _beat(self) -> None:
        while True:
            beat = BeatEvent(run=self._journal.run, seq=self._journal.last_seq, time=now_utc())
            self._voice.say(encode(beat))
            self._supervisor.forget_silent()
            if self._gate.somebody_was_barred():
                # libzmq asks for a key at the handshake alone: all must come in again, and miss nothing by it
                self._intake.cut(self._heard_at, "a key was revoked, and whose this is cannot be told")
            await asyncio.sleep(BEAT)

    def _fitter_changed(self, fitter: FitterState, says: str) -> None:
        self.publish(StateEvent(state=f"fitter-{fitter.state}", says=says, fitter=fitter.name), ())

    def _fitter_died(self, fate: WorkerExit) -> None:
        """Answer in a fitter's place what it died over, so that nobody waits for it in vain.

        It takes one measurement after the other: the first open one is what it died over.
        """
        measurement = self._ledger.first(fate.fitter)
        known = self._journal.measurement(measurement) if measurement and not self._publisher.is_away else None
        if known is None:
            return
        key = (fate.fitter, known.id)
        self._deaths[key] = self._deaths.get(key, 0) + 1
        if self._deaths[key] >= DEATHS:
            refusal = FitEvent(
                measurement=known.id,
                sample=known.sample,
                fitter=fate.fitter,
                version="",
                sweeps=self._journal.sweep_ids(known.id),
                error=f"fitter {fate.fitter!r} died {self._deaths[key]} times over this measurement: {fate.says}",
            )
            self.publish(refusal, ())


def _limits(options: DaemonOptions) -> str:
    """Return the settings that keep the sample and the instrument safe, as the journal keeps them."""
    return (
        f"on {options.resource}; bias up to {_most(options.max_bias_V)}, oscillator up to "
        f"{_most(options.max_oscillator_V)}"
    )


def _most(volts: float | None) -> str:
    return "what the analyzer can" if volts is None else f"{volts:g} V"


def _on_signals(stop: Callable[[], None]) -> None:
    """Let SIGTERM and SIGINT end the daemon in good order."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        if sys.platform == "win32":
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(stop) and None)
        else:
            loop.add_signal_handler(number, stop)
