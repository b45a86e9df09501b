"""One fitter in a process of its own: an ordinary client that fits what it hears and hands in what it found.

python -m pzctl.daemon.server.workers.fitter_worker mason --events tcp://127.0.0.1:5470 --requests tcp://127.0.0.1:5471
"""

import argparse
import logging
import time
from collections.abc import Callable, Sequence

from ....fitters.interface import FitError, FitResult, FitTask, Fitter
from ....fitters.plugins import load_configured
from ....models.sweep import Sweep
from ...client.client import Client
from ...client.protocol import DaemonError
from ...wire.curve_keys import ClientKey
from ...wire.events import ReceivedEvent, StateEvent, SweepEvent
from .visitors import LEASE
from .worker_main import run_as_guest

log = logging.getLogger(__name__)

HELLO_EVERY = LEASE / 5
"""Seconds after which a fitter says hello again."""

PAUSE = 5.0
"""Seconds until a visitor knocks again at a daemon that has gone."""


def task_of(heard: Sequence[ReceivedEvent]) -> FitTask:
    """Return what a fitter is given, of the sweep events of a measurement and of the steps before it."""
    sweeps: dict[str, tuple[Sweep, ...]] = {}
    build = None
    for one in heard:
        if isinstance(one.event, SweepEvent):
            build, step = one.event.build, one.event.sample.step
            sweeps[step] = (*sweeps.get(step, ()), one.sweep())
    return FitTask(build, sweeps)


class FitterWorker:
    """Fits every measurement once."""

    def __init__(self, name: str, fitter: Fitter, client: Client) -> None:
        self._name = name
        self._fitter = fitter
        self._client = client
        self._answered: set[str] = set()
        self._greeted = 0.0

    def serve(self) -> None:
        """Answer what is open, then what comes. Raises DaemonError when the daemon has gone."""
        events = self._client.listen(patience=HELLO_EVERY)
        self._greet()
        for measurement in self._client.unanswered(self._name):
            self.answer(measurement)
        while True:
            for heard in events:
                if isinstance(heard.event, StateEvent) and heard.event.state == "started":  # the daemon, anew
                    self._greet()
                if isinstance(heard.event, SweepEvent) and _completes(heard.event):
                    self.answer(heard.event.measurement)
                if time.monotonic() - self._greeted > HELLO_EVERY:
                    self._greet()
            self._greet()  # nothing came: who is silent for long is taken off the list
            events = self._client.listen(patience=HELLO_EVERY)

    def _greet(self) -> None:
        self._client.hello(self._name, self._fitter.version)
        self._greeted = time.monotonic()

    def answer(self, measurement: str) -> None:
        """Fit a measurement together with the earlier steps of its sample; hand in the result, or why there is none."""
        if measurement in self._answered:
            return
        heard = self._client.sweeps(measurement)
        if not heard:
            return
        try:
            found = self._fitter.fit(task_of(heard))
        except FitError as error:
            found = str(error)
        except MemoryError:  # what it leaked before would make every later fit fail as well: begin anew
            raise
        except Exception as error:
            log.exception("measurement %s", measurement)
            found = f"fitter {self._name!r} failed: {type(error).__name__}: {error}"
        self._hand_in(measurement, [one.event.id for one in heard], found)
        self._answered.add(measurement)

    def _hand_in(self, measurement: str, sweeps: list[str], found: FitResult | str) -> None:
        """Submit; where the daemon refuses the answer, its reason is what the person who waits must see."""
        try:
            self._client.submit(measurement, sweeps, self._name, self._fitter.version, found)
        except DaemonError as error:
            if error.code == "unreachable":
                raise
            says = f"fitter {self._name!r}: its answer was refused: {error}"
            self._client.submit(measurement, sweeps, self._name, self._fitter.version, says)


def _completes(event: SweepEvent) -> bool:
    """Return whether a step's own measurement is complete with this sweep."""
    return event.segment == event.segments and event.decides is None


def visit(name: str, events: str, requests: str, key: ClientKey | None, told: Callable[[str], None]) -> None:
    """Run a fitter for a daemon that did not start it, on another machine say, for ever; come back after the daemon.

    The daemon knows a `module:Class` by its class: it takes no module names from others. `told` is given a sentence
    when it comes and when the daemon has gone. Raises PluginError, and DaemonError where
    the key has no right to hand in fits.
    """
    fitter, known_as = load_configured(name), name.rpartition(":")[2]
    while True:
        try:
            with Client(events, requests, key) as client:
                told(f"fitter {known_as!r} waits for sweeps of the daemon at {requests}")
                FitterWorker(known_as, fitter, client).serve()
        except DaemonError as error:
            if error.code != "unreachable":
                raise
            told(f"{error}; trying again")
        time.sleep(PAUSE)


def main() -> None:
    """Run one fitter until the daemon that started it ends."""
    parser = argparse.ArgumentParser(description="One fitter as a guest of the daemon.")
    parser.add_argument("name", help="an installed fitter, or module:Class")
    run_as_guest(parser, lambda client, given: FitterWorker(given.name, load_configured(given.name), client).serve())


if __name__ == "__main__":
    main()
