"""Repeated measurements: the time from one start to the next."""

import re
import time
from typing import TYPE_CHECKING

from ..analysis.fit_options import UsageError

if TYPE_CHECKING:
    from rich.console import Console

_DURATION = re.compile(r"(\d+(?:\.\d+)?) ?(s|min|h)")
_SECONDS = {"s": 1.0, "min": 60.0, "h": 3600.0}
_SHOWN = 0.5
"""Seconds between two updates of the countdown."""


def duration(text: str, option: str) -> float:
    """Return a time in seconds from `30s`, `10min` or `2h`. Raises UsageError."""
    found = _DURATION.fullmatch(text.strip())
    if found is None:
        raise UsageError(f"{option} {text!r}: a number with s, min or h is needed, for example 10min")
    return float(found[1]) * _SECONDS[found[2]]


class Pause:
    """Waits until so many seconds have passed since the last start."""

    def __init__(self, seconds: float) -> None:
        self._seconds = seconds
        self._next: float | None = None

    def wait(self, console: "Console", done: str) -> None:
        """Wait for the next start with a countdown; the first is at once. A late start does not delay later ones."""
        now = time.monotonic()
        if self._next is None:
            self._next = now
        if self._next > now:
            with console.status(done) as status:
                while (left := self._next - time.monotonic()) > 0:
                    status.update(f"{done}; the next starts in {left:.0f} s (Ctrl-C ends; what is measured is kept)")
                    time.sleep(min(_SHOWN, left))
        self._next += self._seconds
