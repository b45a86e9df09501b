"""The daemon, which owns its analyzers and the journal, answers requests and publishes events.

One asyncio loop owns the journal and answers requests, one thread owns each analyzer, another one the events socket,
and each fitter runs in a process of its own.
"""

import asyncio
import gc
import logging
import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import AsyncExitStack, ExitStack
from dataclasses import asdict, dataclass, replace
from functools import partial
from importlib.metadata import version
from pathlib import Path
from typing import Any

import zmq
import zmq.asyncio

from ...drivers import open_analyzer as open_visa
from ...drivers.base.analyzer import Analyzer, InstrumentError
from ...models.sweep import now_utc
from ...models.sweep_plan import LevelLimits
from ..client.location import Location, announce, withdraw
from ..files.analyzer_options import AnalyzerOptions
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
from .analyzers.acquisition import Acquisition, AnalyzerThread
from .analyzers.compensation_check import CompensationCheck
from .analyzers.plan_limits import PlanLimits
from .analyzers.served_analyzers import ServedAnalyzer, ServedAnalyzers
from .analyzers.simulated_analyzer import simulated_instrument
from .publishing.durable_publisher import DurablePublisher, logged_if_not_kept
from .publishing.event_publisher import EventPublisher
from .publishing.spool import Spool
from .requests.request_handlers import RequestHandlers
from .requests.request_server import RequestServer
from .sockets import access_control_for, bind_events, bind_requests, from_here, port_of
from .workers.backup_schedule import BackupSchedule
from .workers.job_runner import JobRunner, WorkerJob
from .workers.pending_results import PendingResults
from .workers.supervisor import Supervisor, WorkerExit
from .workers.visitors import Visitors

log = logging.getLogger(__name__)

BEAT = 1.0
"""Seconds between two beat events."""

SIMULATED_SECONDS = 30.0
"""Seconds to wait for an answer of the daemon's own simulated instrument, as the machine may be busy."""

DEATHS = 2
"""Number of crashes of a fitter over one measurement after which the daemon answers in its place."""


def run(options: DaemonOptions) -> None:
    """Run a daemon on the user's data folder until it is stopped by SIGTERM, SIGINT or a request.

    Raises FolderError, EndpointError, JournalError or InstrumentError if it cannot start, JournalError if the disk
    fails.
    """
    folder = writable_home()
    with ExitStack() as stack, asyncio.Runner(loop_factory=asyncio.SelectorEventLoop) as runner:
        connections: list[_Connection] = []
        for k, (name, own) in enumerate(options.every_analyzer.items()):
            if own.resource is not None:
                connections.append(_Connection(name, own, open_visa))
                continue
            log_name = "sim" if k == 0 else f"sim-{k + 1}"
            simulated = stack.enter_context(simulated_instrument(log_file(folder, log_name), options.simulator))
            there = replace(own, resource=simulated.instrument, bench=simulated.bench)
            open_simulated = partial(open_visa, timeout_seconds=SIMULATED_SECONDS)
            connections.append(_Connection(name, there, open_simulated, options.simulator.get("time_scale", 1.0)))
        if not options.analyzers:
            only = connections[0].options
            options = replace(options, resource=only.resource, bench=only.bench)
        runner.run(_serve(folder, options, connections))


@dataclass(frozen=True)
class _Connection:
    """An analyzer of the settings whose address is known, and the function that opens it."""

    name: str
    options: AnalyzerOptions
    open: Callable[[str], Analyzer]
    pace: float = 1.0
    """Real seconds per estimated second; less for a simulated instrument that is faster than a real one."""

    @property
    def resource(self) -> str:
        return self.options.resource or ""


async def _serve(folder: Path, options: DaemonOptions, connections: Sequence[_Connection]) -> None:
    """Open everything, serve, and close everything in reverse order, whatever happens."""
    async with AsyncExitStack() as stack:
        journal = JournalWriter(journal_folder(folder), options.journal, options.station)
        stack.callback(journal.close)  # closed last: its lock keeps the next daemon out until everything is released
        withdraw(folder)  # in case a killed daemon left its file
        stack.callback(withdraw, folder)
        context = zmq.asyncio.Context()
        stack.callback(context.term)
        access = access_control_for((options.events, options.requests), keys_folder(folder))
        stack.callback(access.start(context).stop)
        allow_many_files()
        plain: zmq.Context[zmq.Socket[bytes]] = zmq.Context(shadow=context)
        events, events_endpoint = bind_events(plain, options.events, access)
        stack.callback(events.close)
        requests, requests_endpoint = bind_requests(context, options.requests, access)
        stack.callback(requests.close)
        metrics = Metrics()
        most = {port_of(events_endpoint): MOST_SUBSCRIBED, port_of(requests_endpoint): LARGEST_MESSAGE}
        guard = ConnectionGuard(most, metrics.counts)
        event_publisher = EventPublisher(plain, events)
        stack.callback(event_publisher.close, lambda: guard.cut(port_of(events_endpoint), "the daemon ends"))
        opened = await _opened(connections, stack)
        endpoints = (events_endpoint, requests_endpoint)
        daemon = Daemon(journal, event_publisher, requests, guard, metrics, opened, options, folder, endpoints, access)
        where = Location(
            pid=os.getpid(),
            run=journal.run,
            version=version("pzctl"),
            events=from_here(events_endpoint),
            requests=from_here(requests_endpoint),
            resource=connections[0].resource,
            bench=connections[0].options.bench,
            analyzers={connection.name: connection.resource for connection in connections},
            log=str(log_file(folder, "daemon")),
            journal=options.journal,
            station=options.station,
            key=access.local,
        )
        announce(folder, where)
        for one in opened:
            log.info("%s: %s at %s", one.connection.name, one.instrument.idn, one.connection.resource)
        log.info("requests %s, events %s; data %s", requests_endpoint, events_endpoint, folder)
        await daemon.serve()


@dataclass(frozen=True)
class _Opened:
    """An analyzer that has answered."""

    connection: _Connection
    thread: AnalyzerThread
    instrument: InstrumentInfo


async def _opened(connections: Sequence[_Connection], stack: AsyncExitStack) -> list[_Opened]:
    """Open all analyzers, each with its bias off before the first request is read; `stack` closes them.

    One that does not answer keeps no other from being made safe. Raises InstrumentError if one did not.
    """
    threads = [AnalyzerThread(connection.resource, connection.open, connection.pace) for connection in connections]
    for thread in threads:
        stack.push_async_callback(thread.close)
    identities = await asyncio.gather(*(thread.identify() for thread in threads), return_exceptions=True)
    opened: list[_Opened] = []
    failures: list[str] = []
    for connection, thread, identity in zip(connections, threads, identities, strict=True):
        if isinstance(identity, InstrumentError):
            failures.append(f"{connection.name}: {identity}" if len(connections) > 1 else str(identity))
        elif isinstance(identity, BaseException):
            raise identity
        else:
            instrument = InstrumentInfo(**asdict(identity), simulated=connection.options.bench is not None)
            opened.append(_Opened(connection, thread, instrument))
    if failures:
        raise InstrumentError("; ".join(failures))
    return opened


class Daemon:
    """The parts of a daemon and their connections."""

    def __init__(
        self,
        journal: JournalWriter,
        event_publisher: EventPublisher,
        requests: zmq.asyncio.Socket,
        guard: ConnectionGuard,
        metrics: Metrics,
        opened: "Sequence[_Opened]",
        options: DaemonOptions,
        folder: Path,
        endpoints: tuple[str, str],
        access: AccessControl,
    ) -> None:
        self._journal = journal
        self._event_publisher = event_publisher
        self._guard = guard
        self._heard_at = port_of(endpoints[0])
        self._access = access
        self._options = options
        self._folder = folder
        self._stop = asyncio.Event()
        self._deaths: dict[tuple[str, str], int] = {}
        around = (folder, from_here(endpoints[0]), from_here(endpoints[1]), access.local)
        self._metrics = metrics
        self._publisher = DurablePublisher(
            journal, Spool(unsaved_folder(folder)), self._metrics, event_publisher.say, self._said
        )
        self.publish = self._publisher.publish
        check = CompensationCheck(compensation_file(folder), options.compensation_days)
        served = [self._served(one, check) for one in opened]
        self._analyzers = ServedAnalyzers(served, access.may_use)
        self._pending = PendingResults(options.fitters)
        self._supervisor = Supervisor(
            *around,
            limits=options.limits,
            pending=self._pending,
            changed=self._fitter_changed,
            died=self._fitter_died,
            visitors=Visitors((*options.fitters, DIAGNOSIS)),
        )
        self._jobs = JobRunner(*around, options.limits, lambda event: self.publish(event, ()))
        self._backup = BackupSchedule(options.backup, folder, self._tell)
        handlers = RequestHandlers(
            journal=journal,
            analyzers=self._analyzers,
            supervisor=self._supervisor,
            jobs=self._jobs,
            endpoints=endpoints,
            settings=asdict(options) | {"journal": options.journal and without_password(options.journal)},
            begin=self._publisher.begin,
            publish=self.publish,
            shutdown=self._end,
            metrics=self._metrics,
            backup=lambda: self._backup.state,
        )
        self._request_server = RequestServer(requests, handlers, access, guard)

    def _served(self, one: _Opened, check: CompensationCheck) -> ServedAnalyzer:
        name, own = one.connection.name, one.connection.options
        acquisition = Acquisition(name, one.thread, one.instrument, self.publish, self._publisher.there, check)
        limits = PlanLimits(LevelLimits(own.max_bias_V, own.max_oscillator_V))
        return ServedAnalyzer(name, one.instrument, acquisition, limits, own.bench)

    def _said(self, event: Event) -> None:
        """Update the daemon's state after an event was published."""
        self._metrics.note(event)
        self._pending.note(event)
        if isinstance(event, FitEvent):
            self._follow_up(event)
        if isinstance(event, StateEvent):
            log.info("%s", " ".join(filter(None, (event.state, event.measurement or event.fitter, event.says))))

    def _follow_up(self, fit: FitEvent) -> None:
        """Start the diagnosis of a fit with a significant misfit, once for each measurement, in the background."""
        report = fit.report
        if report is None or not is_significant(report.chi2_per_dof, fit.fitter, asdict(self._options)):
            return
        known = self._journal.measurement(fit.measurement)
        if known is not None and not self._journal.answers(known.id, DIAGNOSIS):
            self._jobs.begin(WorkerJob(known.id, None), known, self._journal.sweep_ids(known.id))

    async def serve(self) -> None:
        """Serve until stopped. Raises JournalError if the journal fails."""
        _on_signals(self._end)
        self._publisher.catch_up()
        self.publish(StateEvent(state="started", says=_limits(self._options), client=LOCAL), ())
        for left in self._journal.unfinished():
            says = "the daemon ended before this measurement did; measure again"
            self.publish(StateEvent(state="abandoned", says=says, measurement=left.id, sample=left.sample), ())
        gc.collect()
        gc.freeze()  # present objects stay for ever; collecting them again and again would delay answers
        acquiring = [asyncio.create_task(one.acquisition.work()) for one in self._analyzers.every]
        others = [self._request_server.serve(), self._guard.watch(), self._publisher.mend(), self._beat()]
        others += [self._backup.keep()]
        others += [self._supervisor.keep(name) for name in self._options.fitters]
        tasks = [*acquiring, *map(asyncio.create_task, others)]
        stop = asyncio.create_task(self._stop.wait())
        try:
            await self._until_stopped(stop, acquiring, {*tasks})
        finally:
            self._cancel_all()
            await self._jobs.end()
            for task in (*tasks, stop):
                task.cancel()
            await asyncio.wait((*tasks, stop))
            await self._request_server.end()

    def _end(self) -> None:
        """Start stopping; from now on no client finds this daemon."""
        withdraw(self._folder)
        self._stop.set()

    async def _until_stopped(
        self, stop: "asyncio.Task[Any]", acquiring: "Sequence[asyncio.Task[None]]", tasks: "set[asyncio.Task[None]]"
    ) -> None:
        """Wait until stopped, then for the end of the running measurements. Raise the error of a failed task."""
        while not stop.done():
            done, _ = await asyncio.wait({stop, *tasks}, return_when=asyncio.FIRST_COMPLETED)
            for task in done & tasks:
                task.result()  # only the task of a broken fitter may end; any other has failed
                tasks.discard(task)
        self._tell(StateEvent(state="stopping"))
        self._cancel_all()
        for task, one in zip(acquiring, self._analyzers.every, strict=True):
            queue = one.acquisition
            while not task.done() and (queue.current or (queue.waiting and not self._publisher.is_away)):
                await asyncio.sleep(0.02)

    def _cancel_all(self) -> None:
        for one in self._analyzers.every:
            one.acquisition.cancel_all()

    async def _beat(self) -> None:
        while True:
            beat = BeatEvent(run=self._journal.run, seq=self._journal.last_seq, time=now_utc())
            self._event_publisher.say(encode(beat))
            self._supervisor.forget_silent()
            if self._access.somebody_was_barred():
                # libzmq checks keys at the handshake only: all clients must connect again, and lose nothing by it
                self._guard.cut(self._heard_at, "a key was revoked, so all clients have to connect again")
            await asyncio.sleep(BEAT)

    def _tell(self, event: StateEvent) -> None:
        """Publish what concerns no measurement; if the journal cannot keep it, only the log says so."""
        with logged_if_not_kept(f"{event.state} {event.fitter or ''} {event.says}"):
            self.publish(event, ())

    def _fitter_changed(self, fitter: FitterState, says: str) -> None:
        self._tell(StateEvent(state=f"fitter-{fitter.state}", says=says, fitter=fitter.name))

    def _fitter_died(self, exit_: WorkerExit) -> None:
        """Answer a measurement in place of a fitter that crashed over it repeatedly, so that nobody waits in vain.

        A fitter takes one measurement after the other, so it crashed over the first one that it has not answered.
        """
        measurement = self._pending.first(exit_.fitter)
        if measurement is None or self._publisher.is_away:
            return
        with logged_if_not_kept(f"the end of fitter {exit_.fitter!r} over measurement {measurement}"):
            self._answer_for(exit_, measurement)

    def _answer_for(self, exit_: WorkerExit, measurement: str) -> None:
        known = self._journal.measurement(measurement)
        if known is None:
            return
        key = (exit_.fitter, known.id)
        self._deaths[key] = self._deaths.get(key, 0) + 1
        if self._deaths[key] >= DEATHS:
            refusal = FitEvent(
                measurement=known.id,
                sample=known.sample,
                fitter=exit_.fitter,
                version="",
                sweeps=self._journal.sweep_ids(known.id),
                error=f"fitter {exit_.fitter!r} crashed {self._deaths[key]} times over this measurement: {exit_.says}",
            )
            self.publish(refusal, ())


def _limits(options: DaemonOptions) -> str:
    """Return the resources and the limits that protect samples and instruments, as a sentence for the journal."""
    return "; ".join(
        f"{f'{name}: ' if options.analyzers else ''}on {own.resource or 'a simulated 4294A'}; bias up to "
        f"{_most(own.max_bias_V)}, oscillator up to {_most(own.max_oscillator_V)}"
        for name, own in options.every_analyzer.items()
    )


def _most(volts: float | None) -> str:
    return "the analyzer's limit" if volts is None else f"{volts:g} V"


def _on_signals(stop: Callable[[], None]) -> None:
    """Let SIGTERM and SIGINT stop the daemon in an orderly way."""
    loop = asyncio.get_running_loop()
    for number in (signal.SIGTERM, signal.SIGINT):
        if sys.platform == "win32":
            signal.signal(number, lambda *_: loop.call_soon_threadsafe(stop) and None)
        else:
            loop.add_signal_handler(number, stop)
