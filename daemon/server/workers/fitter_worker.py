"""The process of one fitter: an ordinary client that fits every measurement and submits the results.

python -m pzctl.daemon.server.workers.fitter_worker mason --events tcp://127.0.0.1:5470 --requests tcp://127.0.0.1:5471
"""

import argparse
import logging
import time
from collections.abc import Callable, Sequence

from ....fitters.interface import FitResult, FitTask, Fitter
from ....fitters.plugins import PluginError, load_configured, run
from ....models.base.errors import PzctlError
from ....models.sweep import Sweep
from ...client.client import Client
from ...client.protocol import DaemonError
from ...wire.curve_keys import ClientKey
from ...wire.events import ReceivedEvent, StateEvent, SweepEvent
from .visitors import LEASE
from .worker_main import run_worker

log = logging.getLogger(__name__)

HELLO_EVERY = LEASE / 5
"""Seconds after which a fitter says hello again."""

PAUSE = 5.0
"""Seconds until a visiting fitter tries again to reach a daemon."""


def task_of(events: Sequence[ReceivedEvent]) -> FitTask:
    """Return the fit task from the sweep events of a measurement and of the steps before it."""
    sweeps: dict[str, tuple[Sweep, ...]] = {}
    build = None
    for received in events:
        if isinstance(received.event, SweepEvent):
            build, step = received.event.build, received.event.sample.step
            sweeps[step] = (*sweeps.get(step, ()), received.sweep())
    return FitTask(build, sweeps)


class FitterWorker:
    """A fitter that answers every measurement once."""

    def __init__(self, name: str, fitter: Fitter, client: Client) -> None:
        self._name = name
        self._fitter = fitter
        self._client = client
        self._answered: set[str] = set()
        self._greeted = 0.0

    def serve(self) -> None:
        """Answer the open measurements, then every new one. Raises DaemonError when the daemon has ended."""
        events = self._client.listen(patience=HELLO_EVERY)
        self._greet()
        for measurement in self._client.unanswered(self._name):
            self.answer(measurement)
        while True:
            for received in events:
                event = received.event
                if isinstance(event, StateEvent) and event.state == "started":  # the daemon was restarted
                    self._greet()
                if isinstance(event, SweepEvent) and _completes(event):
                    self.answer(event.measurement)
                if time.monotonic() - self._greeted > HELLO_EVERY:
                    self._greet()
            self._greet()  # no event came; the daemon removes silent fitters from its list
            events = self._client.listen(patience=HELLO_EVERY)

    def _greet(self) -> None:
        self._client.hello(self._name, self._fitter.version)
        self._greeted = time.monotonic()

    def answer(self, measurement: str) -> None:
        """Fit a measurement with the earlier steps of its sample; submit the result or the reason why there is none."""
        if measurement in self._answered:
            return
        events = self._client.sweeps(measurement)
        if not events:
            return
        try:
            answer = run(self._fitter, task_of(events))
        except MemoryError:  # leaked memory would make every later fit fail too: let the process be restarted
            raise
        except PzctlError as error:
            if isinstance(error, PluginError):  # a defect of the fitter
                log.exception("measurement %s", measurement)
            answer = str(error)
        except Exception as error:
            log.exception("measurement %s", measurement)
            answer = f"{type(error).__name__}: {error}"
        self._submit(measurement, [received.event.id for received in events], answer)
        self._answered.add(measurement)

    def _submit(self, measurement: str, sweeps: list[str], answer: FitResult | str) -> None:
        """Submit an answer; if the daemon refuses it, submit the reason, so that the person who waits sees it."""
        try:
            self._client.submit(measurement, sweeps, self._name, self._fitter.version, answer)
        except DaemonError as error:
            if error.code == "not-measured":  # it was withdrawn meanwhile, so nobody waits for the answer
                return
            if error.code == "unreachable":
                raise
            says = f"fitter {self._name!r}: its answer was refused: {error}"
            self._client.submit(measurement, sweeps, self._name, self._fitter.version, says)


def _completes(event: SweepEvent) -> bool:
    """Return whether this sweep is the last one of a step's own measurement."""
    return event.segment == event.segments and event.decides is None


def visit(name: str, events: str, requests: str, key: ClientKey | None, report: Callable[[str], None]) -> None:
    """Run a fitter for a daemon that did not start it, for example on another machine, and reconnect when needed.

    The daemon knows a `module:Class` by its class name, since it accepts no module names from clients. `report` is
    called with a sentence when the fitter has connected and when the daemon has ended. Raises PluginError, or
    DaemonError if the key has no right to submit fits.
    """
    fitter, known_as = load_configured(name), name.rpartition(":")[2]
    while True:
        try:
            with Client(events, requests, key) as client:
                report(f"fitter {known_as!r} waits for sweeps of the daemon at {requests}")
                FitterWorker(known_as, fitter, client).serve()
        except DaemonError as error:
            if error.code != "unreachable":
                raise
            report(f"{error}; trying again")
        time.sleep(PAUSE)


def main() -> None:
    """Run one fitter until the daemon that started it ends."""
    parser = argparse.ArgumentParser(description="One fitter as a worker of the daemon.")
    parser.add_argument("name", help="an installed fitter, or module:Class")
    run_worker(parser, lambda client, given: FitterWorker(given.name, load_configured(given.name), client).serve())


if __name__ == "__main__":
    main()
