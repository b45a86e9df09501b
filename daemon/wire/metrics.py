"""The daemon's counters and times, which clients can request."""

import time
from collections import Counter, deque
from collections.abc import Iterable

import msgspec

from .events import Event, FitEvent, StateEvent

KEPT = 1000
"""Number of latest durations of each kind that the statistics use."""


class TimingSummary(msgspec.Struct, frozen=True):
    """Statistics of the latest durations of one kind, in seconds."""

    count: int
    """Number of durations."""
    median: float | None
    p99: float | None


class Metrics:
    """Counters since the start of the daemon, and the latest durations."""

    def __init__(self) -> None:
        self.began = time.monotonic()
        self.counts: Counter[str] = Counter()
        self._durations: dict[str, deque[float]] = {}
        self._measured: dict[str, float] = {}

    def lasted(self, what: str, seconds: float) -> None:
        """Record a duration of the kind `what`."""
        self._durations.setdefault(what, deque(maxlen=KEPT)).append(seconds)

    def note(self, event: Event) -> None:
        """Count an event; for a fit, also record how long after the end of its measurement it came."""
        kind = str(event.__struct_config__.tag)
        self.counts[kind if not isinstance(event, StateEvent) else f"state-{event.state}"] += 1
        if isinstance(event, StateEvent) and event.state == "measured" and event.measurement:
            self._measured[event.measurement] = time.monotonic()
            if len(self._measured) > KEPT:
                del self._measured[next(iter(self._measured))]
        if isinstance(event, FitEvent) and event.measurement in self._measured:
            self.lasted("fit", time.monotonic() - self._measured[event.measurement])

    def spreads(self) -> dict[str, TimingSummary]:
        """Return the statistics of each kind of duration."""
        return {what: _spread(durations) for what, durations in self._durations.items()}


def _spread(durations: Iterable[float]) -> TimingSummary:
    ordered = sorted(durations)
    if not ordered:
        return TimingSummary(0, None, None)
    return TimingSummary(
        len(ordered), ordered[len(ordered) // 2], ordered[min(len(ordered) - 1, int(0.99 * len(ordered)))]
    )
