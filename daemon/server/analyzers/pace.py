"""The time a measurement really takes, learned while it runs: analyzers report theirs by a formula.

A formula is off by some per cent for an instrument, and by much for a simulated one that answers faster than a real
one. The first sweep of a measurement tells how fast the next ones will be, and each measurement tells it to the next.
"""

import time
from collections.abc import Callable
from dataclasses import replace

from ....drivers.base.analyzer import Progress

MOST = 0.99
"""Largest reported fraction of a measurement that still runs."""


class Pace:
    """Real seconds per estimated second of an analyzer; `expected` before anything was measured."""

    def __init__(self, expected: float = 1.0, clock: Callable[[], float] = time.monotonic) -> None:
        self._pace = expected
        self._clock = clock

    def corrected(self, estimated: float, report: Callable[[Progress], None]) -> "PacedProgress":
        """Return what corrects the progress of a measurement of `estimated` seconds, and passes it on to `report`."""
        return PacedProgress(self, estimated, report)

    def learn(self, pace: float) -> None:
        """Expect this pace from now on."""
        self._pace = pace

    @property
    def now(self) -> float:
        """The pace that is expected at present."""
        return self._pace

    def seconds(self) -> float:
        """Return the time of the clock, s."""
        return self._clock()


class PacedProgress:
    """Progress of one measurement with true times."""

    def __init__(self, pace: Pace, estimated: float, report: Callable[[Progress], None]) -> None:
        self._pace = pace
        self._estimated = estimated
        self._report = report
        self._begun = pace.seconds()
        self._part = ""
        self._part_begun = self._begun
        self._before = 0.0
        """Fraction of the measurement before the present sweep, by the formula."""
        self._said = 0.0

    def __call__(self, progress: Progress) -> None:
        """Pass on the progress that an analyzer reports."""
        now = self._pace.seconds()
        if progress.what != self._part:
            self._part, self._part_begun, self._before = progress.what, now, progress.fraction
            self._learn(now, progress.fraction)
        whole = self._estimated * self._pace.now
        if whole <= 0:
            self._report(replace(progress, seconds_left=progress.seconds_left * self._pace.now))
            return
        fraction = min(self._before + (now - self._part_begun) / whole, MOST)
        self._said = max(fraction, self._said)
        self._report(Progress(self._said, (1 - self._said) * whole, progress.what))

    def done(self) -> None:
        """Learn from the whole measurement, which is complete."""
        self._learn(self._pace.seconds(), 1.0)

    def _learn(self, now: float, fraction: float) -> None:
        if fraction > 0 and self._estimated > 0 and now > self._begun:
            self._pace.learn((now - self._begun) / (fraction * self._estimated))
