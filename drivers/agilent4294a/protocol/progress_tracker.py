"""Progress of a measurement, and its cancellation on request."""

from collections.abc import Callable, Sequence

from ...base.analyzer import Cancelled, Progress


class ProgressTracker:
    """Progress of several sweeps; `seconds` has the duration of each."""

    def __init__(
        self, seconds: Sequence[float], progress: Callable[[Progress], None], cancelled: Callable[[], bool]
    ) -> None:
        self._seconds = seconds
        self._progress = progress
        self._cancelled = cancelled
        self._number = 0

    def next(self) -> Callable[[float], None]:
        """Return the callback of the next sweep: it reports progress, and raises Cancelled on request."""
        total, before, expected = sum(self._seconds), sum(self._seconds[: self._number]), self._seconds[self._number]
        self._number += 1
        what = f"sweep {self._number} of {len(self._seconds)}"

        def tick(passed: float) -> None:
            if self._cancelled():
                raise Cancelled(f"{what} was cancelled after {passed:.0f} s; the instrument is in HOLD, its bias off")
            done = before + min(passed, expected)
            self._progress(Progress(done / total, max(total - done, 0.0), what))

        return tick
