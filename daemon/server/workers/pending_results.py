"""Who owes an answer to what: so that a fitter that hangs is found, and what it hangs on is known."""

import time
from collections.abc import Callable, Iterable

from ...wire.events import DiagnosisEvent, Event, FitEvent, StateEvent


class PendingResults:
    """The measurements that each kept fitter has still to answer, in the order in which it takes them."""

    def __init__(self, fitters: Iterable[str], clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._open: dict[str, dict[str, None]] = {fitter: {} for fitter in fitters}
        self._since: dict[str, float] = {}

    def note(self, event: Event) -> None:
        """Take note of an event: a complete measurement opens an entry for every fitter, its answer closes it."""
        if isinstance(event, StateEvent) and event.state == "measured" and event.measurement:
            for fitter, waiting in self._open.items():
                if not waiting:
                    self._since[fitter] = self._clock()
                waiting[event.measurement] = None
        elif isinstance(event, FitEvent | DiagnosisEvent) and event.fitter in self._open:
            self._open[event.fitter].pop(event.measurement, None)
            self._since[event.fitter] = self._clock()

    def first(self, fitter: str) -> str | None:
        """Return the measurement that a fitter is busy with; None where it has nothing to do."""
        return next(iter(self._open.get(fitter, {})), None)

    def waited(self, fitter: str, began: float) -> float:
        """Return the seconds that a fitter, whose process began at `began` (of the clock), has taken for the first."""
        if self.first(fitter) is None:
            return 0.0
        return self._clock() - max(began, self._since[fitter])
