"""The results that each fitter still owes, which show whether a fitter hangs, and over which measurement."""

import time
from collections.abc import Callable, Iterable

from ...journal.stores.event_rows import WITHDRAWN
from ...wire.events import DiagnosisEvent, Event, FitEvent, StateEvent


class PendingResults:
    """The unanswered measurements of each fitter that the daemon keeps, in the order in which it takes them."""

    def __init__(self, fitters: Iterable[str], clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._open: dict[str, dict[str, None]] = {fitter: {} for fitter in fitters}
        self._since: dict[str, float] = {}

    def note(self, event: Event) -> None:
        """Update the list: a complete measurement adds an entry for every fitter, and its answer removes it."""
        if isinstance(event, StateEvent) and event.state == "measured" and event.measurement:
            for fitter, waiting in self._open.items():
                if not waiting:
                    self._since[fitter] = self._clock()
                waiting[event.measurement] = None
        elif isinstance(event, StateEvent) and event.state == WITHDRAWN and event.measurement:
            for waiting in self._open.values():  # it takes no answers any more
                waiting.pop(event.measurement, None)
        elif isinstance(event, FitEvent | DiagnosisEvent) and event.fitter in self._open:
            self._open[event.fitter].pop(event.measurement, None)
            self._since[event.fitter] = self._clock()

    def first(self, fitter: str) -> str | None:
        """Return the measurement that a fitter is working on, or None if it has answered all."""
        return next(iter(self._open.get(fitter, {})), None)

    def waited(self, fitter: str, began: float) -> float:
        """Return the seconds that a fitter has worked on its first measurement; its process started at `began`."""
        if self.first(fitter) is None:
            return 0.0
        return self._clock() - max(began, self._since[fitter])
