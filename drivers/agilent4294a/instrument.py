"""The 4294A as an `Analyzer`: it carries out whole plans and leaves the instrument as it was found."""

import dataclasses
from collections.abc import Callable, Sequence
from typing import TypeVar

from ...models.sweep import Sweep
from ...models.sweep_plan import Segment, SweepPlan
from ..base.analyzer import Cancelled, FileKind, Identity, InstrumentError, Progress
from ..base.capabilities import Capabilities
from ..base.compensation import Compensation, Standard
from ..visa import replies
from ..visa.connection import Connection, ConnectionLost
from . import instrument_files as files
from . import limits
from .capabilities import CAPABILITIES
from .compensation import standards as compensation
from .driver import IDN
from .protocol import saved_state as state
from .protocol import settings
from .protocol.progress_tracker import ProgressTracker
from .sweeps import grid, list_sweep
from .sweeps.joined_segments import joined
from .sweeps.single_sweep import expected_seconds, sweep
from .sweeps.sweep_record import record

Result = TypeVar("Result")


class Agilent4294A:
    """An Agilent (HP, Keysight) 4294A at the other end of `link`. See `Analyzer` for the contract."""

    def __init__(self, link: Connection) -> None:
        self._link = link
        self._no_list = ""
        """Why this instrument cannot do a list sweep; set after one failed at its end."""

    @property
    def hears_requests(self) -> bool:
        """Whether a service request signals the end of a sweep; if not, the status byte is polled."""
        return self._link.hears_requests

    @property
    def capabilities(self) -> Capabilities:
        """What a 4294A can do."""
        return CAPABILITIES

    def identify(self) -> Identity:
        """Query the identification. Raises InstrumentError where the answer is not a 4294A's."""
        try:
            answer = self._link.ask("*IDN?")
        except ConnectionLost:  # it was switched off and on since the last connection
            answer = self._link.ask("*IDN?")
        found = IDN.fullmatch(answer.strip())
        if not found:
            raise InstrumentError(
                f"{self._link.name}: *IDN? is answered by {replies.quote(answer)}; "
                "this driver needs an HP, Agilent or Keysight 4294A"
            )
        return Identity(self._link.name, answer.strip(), "4294A", found[2].strip(), found[3].strip())

    def make_safe(self) -> None:
        """Switch the bias off, whoever left it on, and verify it. Raises InstrumentError."""
        if replies.flag(self._link.ask("DCO OFF;DCO?"), f"{self._link.name}: bias (DCO?)"):
            raise InstrumentError(state.STILL_BIASED.format(self._link.name))

    def estimated_seconds(self, plan: SweepPlan) -> float:
        """Return the longest time that `plan` will take, in s. Raises PlanError where a 4294A cannot do it."""
        limits.check(plan)
        return sum(self._one_by_one_seconds(plan))

    def measure(
        self,
        plan: SweepPlan,
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> tuple[Sweep, ...]:
        """Carry out `plan`: one Sweep for each segment, or one for all that are joined; see `Analyzer.measure`.

        Each segment is swept separately, in overlapping parts if it has more than 801 points. Joined segments are
        measured by list sweep if the instrument is verified to accept it. If a sweep is good but the settings could
        not be restored, the notes of the Sweep say so; if the bias could not be switched off, InstrumentError is
        raised all the same.
        """
        limits.check(plan)

        def sweep_all(identity: Identity, found: state.SavedState) -> tuple[Sweep, ...]:
            settings.check_corrections(self._link)
            if not plan.joined:
                return self._one_by_one(
                    plan, identity, ProgressTracker(self._one_by_one_seconds(plan), progress, cancelled)
                )
            why = list_sweep.why_not(plan) or self._no_list
            if not why and found.values["SWPT"] == "LIST":
                why = "its list-sweep table is in use"
            if not why:
                try:
                    return self._by_list(plan, identity, progress, cancelled)
                except list_sweep.ListRefused as error:
                    why = str(error)
                    self._no_list = why if error.swept else ""
            course = ProgressTracker(self._one_by_one_seconds(plan), progress, cancelled)
            return (joined(self._one_by_one(plan, identity, course), 0, why),)

        sweeps, left = self._as_found(sweep_all)
        return sweeps if not left else tuple(dataclasses.replace(s, notes=(*s.notes, left)) for s in sweeps)

    def compensate(
        self,
        standards: Sequence[Standard],
        prompt: Callable[[str], None],
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
        adapter: str = "OFF",
    ) -> Compensation:
        """Measure the fixture's `standards`, each after `prompt` has returned from asking a person to put it in.

        The instrument corrects every later sweep by them; the arrays are returned to be stored. `adapter`: token of
        `E4TP`. Raises InstrumentError where a standard is wrong, Cancelled, and whatever `prompt` raises.
        """

        def tick(passed: float, what: str) -> None:
            if cancelled():
                raise Cancelled(f"the {what} compensation was cancelled; the instrument is in HOLD, its bias off")
            left = max(compensation.STANDARD_SECONDS - passed, 0.0)
            progress(Progress(min(passed / compensation.STANDARD_SECONDS, 1.0), left, f"{what} compensation"))

        def measure_all(identity: Identity, _: state.SavedState) -> Compensation:
            return compensation.measure(self._link, identity, standards, adapter, prompt, tick)

        return self._as_found(measure_all)[0]

    def restore(self, stored: Compensation) -> None:
        """Write the arrays of `stored` back to the instrument and switch them on. Raises InstrumentError."""
        self._as_found(lambda identity, _: compensation.apply(self._link, identity, stored))

    def fetch(self, kind: FileKind) -> bytes:
        """Return a file that the instrument generates. Raises InstrumentError.

        `screen`: a TIFF of its screen; `ascii`, `binary`, `touchstone`: the sweep on the screen, in its own formats. It
        is not that of the last plan, because the instrument's own settings were restored after it.
        """
        return files.fetch(self._link, kind)

    def close(self) -> None:
        """Close the connection to the instrument."""
        self._link.close()

    @staticmethod
    def _one_by_one_seconds(plan: SweepPlan) -> list[float]:
        """Return the time of each sweep where every segment is swept separately."""
        return [expected_seconds(part, plan) for segment in plan.segments for part in _sweeps_of(segment)]

    def _one_by_one(self, plan: SweepPlan, identity: Identity, course: ProgressTracker) -> tuple[Sweep, ...]:
        return tuple(
            record(
                [sweep(self._link, part, plan, course.next()) for part in _sweeps_of(segment)], segment, plan, identity
            )
            for segment in plan.segments
        )

    def _by_list(
        self,
        plan: SweepPlan,
        identity: Identity,
        progress: Callable[[Progress], None],
        cancelled: Callable[[], bool],
    ) -> tuple[Sweep, ...]:
        """Return the single recording of a joined plan. Also raises ListRefused."""
        batches = list_sweep.batches(plan)
        course = ProgressTracker([list_sweep.expected(batch, plan) for batch in batches], progress, cancelled)
        sweeps = [
            record([raw], segment, plan, identity)
            for batch in batches
            for segment, raw in zip(batch, list_sweep.sweep(self._link, batch, plan, course.next()), strict=True)
        ]
        return (joined(sweeps, len(batches)),)

    def _as_found(self, action: Callable[[Identity, state.SavedState], Result]) -> tuple[Result, str]:
        """Do `action` on the instrument in HOLD, then restore it; return the result and what could not be restored."""
        identity = self.identify()
        found: state.SavedState | None = None
        try:
            found = state.take(self._link)
            result = action(identity, found)
            self._check_in_step(identity)
        except BaseException as error:
            self._leave_after(error, found)
            raise
        return result, self._leave(found, resume=True)

    def _check_in_step(self, identity: Identity) -> None:
        """Detect a connection that is out of step by one answer: every reply would belong to the query before."""
        if (answer := self._link.ask("*IDN?").strip()) != identity.idn:
            raise InstrumentError(
                f"{self._link.name}: *IDN? is answered by {replies.quote(answer)} after the sweep and was "
                f"{replies.quote(identity.idn)} before it; the answers are out of step"
            )

    def _leave_after(self, error: BaseException, found: state.SavedState | None) -> None:
        """Make the instrument safe after `error`; add to the error what could not be done."""
        try:
            if not isinstance(error, Cancelled):  # a cancelled wait ends between two exchanges, so answers are in step
                self._link.doubt()
            left = self._leave(found, resume=False)
        except InstrumentError as second:
            left = str(second)
        if left and isinstance(error, InstrumentError):
            raise type(error)(f"{error}. Besides: {left}") from None
        if left:
            error.add_note(left)

    def _leave(self, found: state.SavedState | None, resume: bool) -> str:
        """Switch the bias off and restore the settings; return "", or a sentence on what could not be restored.

        Raises InstrumentError where the bias is not known to be off: this must not be overlooked.
        """
        self._twice(lambda: state.bias_off(self._link))
        try:
            if found is not None:
                self._twice(lambda: state.give_back(self._link, found, resume))
        except InstrumentError as error:
            return f"The instrument could not be left as found: {error}"
        return ""

    def _twice(self, action: Callable[[], None]) -> None:
        """Do `action`; where it fails, try once more on a new connection."""
        try:
            action()
        except InstrumentError:
            self._link.doubt()
            action()


def _sweeps_of(segment: Segment) -> tuple[Segment, ...]:
    return tuple(grid.of_part(part) for part in grid.parts(segment))
