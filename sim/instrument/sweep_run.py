"""Running sweeps: overlapped, in scaled time, with triggers and averaging; the data array appears at the end.

Nothing here waits. Callers first call `advance`, which brings the sweeps up to the clock.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Impedances, Reals
from ..bench.bench import Bench
from ..language.messages import CommandError
from .axis import Axis
from .monitors import Monitors, monitored, needs_less_level
from .state import State
from .status import CORRECTION_DONE, INSTRUMENT_SUMMARY, POINT_DONE, SWEEP_DONE, TRIGGER_WAITING, Status
from .sweep_timing import point_seconds

Indices: TypeAlias = NDArray[np.intp]

FOREVER = -1
"""Number of sweeps in CONT."""


@dataclass(eq=False)
class Running:
    """A sweep that is running or waits for its trigger."""

    axis: Axis
    points_s: Reals
    """Unscaled seconds of each point, shape (N,)."""
    began: float | None
    """Clock time of the trigger; None before it."""
    seconds: float
    """Scaled seconds from trigger to end."""
    left: int
    """Remaining sweeps, including this one; FOREVER in CONT."""
    done: Callable[[Axis, Impedances], None] | None = None
    """Receives a finished correction standard; None for an ordinary sweep."""
    then_continue: bool = False
    """Whether CONT resumes afterwards, because a standard was measured in between."""
    at: Indices | None = None
    """Points of the axis that a manual sweep measures; None for all."""
    triggered: int = 0
    """Points that have had their trigger (TRGEVE POIN)."""


class Sweeper:
    """Runs sweeps of the bench and holds the data of the last finished one."""

    def __init__(
        self,
        bench: Bench,
        state: State,
        status: Status,
        clock: Callable[[], float],
        time_scale: float,
        corrected: Callable[[Axis, Impedances], Impedances],
    ) -> None:
        self.bench, self.state, self.status = bench, state, status
        self.clock, self.time_scale = clock, time_scale
        self._corrected = corrected
        self.running: Running | None = None
        self.axis: Axis = state.axis()
        self.data: Impedances = np.zeros(self.axis.values.size, dtype=np.complex128)
        self.averaged = 0
        """Sweeps in the average so far."""
        self.monitors = Monitors()
        """Readings of the last finished sweep."""
        self.written: dict[str, Reals] = {}
        """Data traces that a computer wrote (INPUDTRC), pairs by trace, until the next sweep."""
        self.manual_point, self.manual_range = 1, (0, 0)
        """MANP and MANR."""
        self.finished = False
        """Whether a sweep has ended since this was last read."""

    @property
    def continuous(self) -> bool:
        """Whether the sweep mode is CONT."""
        return self.running is not None and self.running.left == FOREVER

    @property
    def measures_standard(self) -> bool:
        """Whether a standard of calibration or compensation is being measured."""
        return self.running is not None and self.running.done is not None

    def forget(self) -> None:
        """Drop the data, because the axis has changed."""
        self.axis = self.state.axis()
        self.data = np.zeros(self.axis.values.size, dtype=np.complex128)
        self.averaged = 0
        self.monitors, self.written = Monitors(), {}
        self.manual_point, self.manual_range = 1, (0, 0)

    def start(
        self, sweeps: int, done: Callable[[Axis, Impedances], None] | None = None, axis: Axis | None = None
    ) -> None:
        """Begin this many sweeps; a correction standard gives its own axis. Raises CommandError for an empty list."""
        at = None
        if axis is None:
            axis = self.state.axis()
            if self.state.on("MANS"):
                at = self._manual()
                axis = Axis(**{name: values[at] for name, values in vars(axis).items()})
        points_s = point_seconds(axis, self.state.real("PDELT"))
        seconds = (float(points_s.sum()) + self.state.real("SDELT")) * self.time_scale
        goes_on = done is not None and self.running is not None and (self.continuous or self.running.then_continue)
        self.running = Running(axis, points_s, None, seconds, sweeps, done, goes_on, at)
        if done is not None or self.state["TRGS"] == "INT":
            self.running.began = self.clock()
        else:
            self.status.raise_instrument(TRIGGER_WAITING)

    def _manual(self) -> Indices:
        """Return the points that a manual sweep measures: MANR where it is a range, else MANP (PM p.346)."""
        first, last = self.manual_range
        if first >= last:
            first = last = self.manual_point
        return np.arange(first - 1, last, dtype=np.intp)

    def restart(self) -> None:
        """Restart the running sweep, because a setting has changed."""
        self.averaged = 0
        if self.running is not None and self.running.done is None:
            self.start(self.running.left)

    def hold(self) -> None:
        """Stop sweeping; the data stay unchanged."""
        self.running = None

    def trigger(self) -> bool:
        """Trigger the waiting sweep; return whether one was waiting."""
        if self.running is None or self.running.began is not None:
            return False
        if self.state["TRGEVE"] == "POIN":
            self.running.triggered += 1
            if self.status.instrument_enable & POINT_DONE and self.status.request_enable & INSTRUMENT_SUMMARY:
                self.status.raise_instrument(POINT_DONE)
            if self.running.triggered < self.running.axis.values.size:
                return True
        self.running.began = self.clock()
        return True

    def seconds_left(self) -> float:
        """Return the seconds until no operation is pending: 0 when idle or in CONT, infinite without a trigger."""
        running = self.running
        if running is None or running.left == FOREVER:
            return 0.0
        if running.began is None or (running.left > 1 and self._waits_for_triggers(running)):
            return math.inf
        return max(0.0, running.began + running.left * running.seconds - self.clock())

    def progress(self) -> float:
        """Return how much of the running sweep is done, 0 to 1; 1 when none runs."""
        if self.running is None:
            return 1.0
        if self.running.began is None:
            return 0.0
        return min(1.0, (self.clock() - self.running.began) / max(self.running.seconds, 1e-12))

    def advance(self) -> None:
        """Finish every sweep whose time is over; in CONT compute only the newest, because no client saw the others."""
        now = self.clock()
        while (running := self.running) is not None and running.began is not None:
            if now < running.began + running.seconds:
                return
            self._finish(running)
            if running.left == FOREVER:
                running.began, running.triggered = (None if self._waits_for_triggers(running) else now), 0
                return
            running.left -= 1
            if running.left == 0:
                self.running = None
                self.status.raise_instrument(SWEEP_DONE if running.done is None else CORRECTION_DONE)
                if running.then_continue:
                    self.start(FOREVER)
            elif self._waits_for_triggers(running):
                running.began, running.triggered = None, 0
                self.status.raise_instrument(TRIGGER_WAITING)
            else:
                running.began += running.seconds

    def _waits_for_triggers(self, running: Running) -> bool:
        return running.done is None and self.state["TRGS"] != "INT"

    def _finish(self, running: Running) -> None:
        reverse = self.state["SWED"] == "DOWN"
        measured = self.bench.measure(running.axis, running.points_s, reverse, running.left == FOREVER)
        if running.done is not None:
            running.done(running.axis, measured)
            return
        new = self._corrected(running.axis, measured)
        self.averaged += 1
        if self.state.on("AVER") and self.averaged > 1 and running.at is None:
            # OM p.126: A_n = S_n/F + (1 - 1/F) A_(n-1), where F counts up to the factor
            share = 1 / min(self.averaged, self.state.count("AVERFACT"))
            new = share * new + (1 - share) * self.data
        if running.at is not None:
            new = self._among_the_others(running.at, new)
        self.axis, self.data = self.state.axis(), new
        self.written, self.finished = {}, True
        self.monitors = monitored(self.state, self.axis, new)
        if needs_less_level(running.axis, measured, self.state):
            self.status.error(CommandError(134))

    def _among_the_others(self, at: Indices, new: Impedances) -> Impedances:
        """Return the data array updated with these points of a manual sweep."""
        size = self.state.axis().values.size
        data = self.data.copy() if self.data.size == size else np.zeros(size, dtype=np.complex128)
        data[at] = new
        return data
