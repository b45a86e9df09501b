"""Repeated measurements: the time from one start to the next."""

import time
from collections.abc import Iterator
from typing import TYPE_CHECKING

from ...files.durations import seconds_of
from ..analysis.fit_options import UsageError

if TYPE_CHECKING:
    from rich.console import Console

_SHOWN = 0.5
"""Seconds between two updates of the countdown."""


def duration(text: str, option: str) -> float:
    """Return a time in seconds from `30s`, `10min` or `2h`. Raises UsageError."""
    seconds = seconds_of(text)
    if seconds is None:
        raise UsageError(f"{option} {text!r}: a number with s, min or h is needed, for example 10min")
    return seconds


class Pause:
    """Waits until so many seconds have passed since the last start."""

    def __init__(self, seconds: float, first: float = 0.0) -> None:
        """Begin; the first start is `first` seconds from now."""
        self._seconds = seconds
        self._next = time.monotonic() + first

    def starts(self, count: int, name: str, console: "Console") -> Iterator[int]:
        """Yield the number of each of `count` starts, from 0, at its time; say which it is if there are several."""
        for number in range(count):
            self.wait(console, f"{name}: {number} of {count} measured")
            if count > 1:
                console.print(f"{name}, {number + 1} of {count}:", highlight=False)
            yield number

    def wait(self, console: "Console", done: str) -> None:
        """Wait for the next start with a countdown. A late start does not delay later ones."""
        if self._next > time.monotonic():
            with console.status(done) as status:
                while (left := self._next - time.monotonic()) > 0:
                    status.update(f"{done}; the next starts in {left:.0f} s (Ctrl-C ends; what is measured is kept)")
                    time.sleep(min(_SHOWN, left))
        self._next += self._seconds
