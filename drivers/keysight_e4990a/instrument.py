"""The E4990A as an `Analyzer`: it carries out whole plans and leaves the instrument as it was found."""

import dataclasses
from collections.abc import Callable, Mapping, Sequence
from itertools import pairwise
from typing import Any, TypeVar

import numpy as np

from ...models.sweep import Sweep
from ...models.sweep_plan import PlanError, Segment, SweepPlan
from ..base.analyzer import Analyzer, Cancelled, Identity, InstrumentError, Progress
from ..base.capabilities import Capabilities, named_segments
from ..base.compensation import Compensation, Standard
from ..base.per_point import gain_per_point, per_point
from ..visa import replies
from ..visa.connection import Connection, ConnectionLost
from . import compensation, settings
from .accuracy import gain_accuracy, relative_accuracy, relative_noise
from .capabilities import CAPABILITIES
from .driver import IDN
from .sweeps import SweepReadout, points, set_up, sweep

Result = TypeVar("Result")


class KeysightE4990A(Analyzer):
    """A Keysight (Agilent) E4990A at the other end of `link`. See `Analyzer` for the contract."""

    def __init__(self, link: Connection) -> None:
        self._link = link

    @property
    def hears_requests(self) -> bool:
        """Whether a service request signals the end of a sweep; if not, the instrument is polled."""
        return False

    @property
    def capabilities(self) -> Capabilities:
        """The capabilities of an E4990A."""
        return CAPABILITIES

    def identify(self) -> Identity:
        """Query the identification. Raises InstrumentError where the answer is not an E4990A's."""
        try:
            answer = self._link.ask("*IDN?").strip()
        except ConnectionLost:  # it was switched off and on since the last connection
            answer = self._link.ask("*IDN?").strip()
        found = IDN.fullmatch(answer)
        if not found:
            raise InstrumentError(
                f"{self._link.name}: *IDN? is answered by {replies.quote(answer)}; this driver needs an E4990A"
            )
        return Identity(self._link.name, answer, "E4990A", found[2].strip(), found[3].strip())

    def make_safe(self) -> None:
        """Switch the bias off, whoever left it on, and verify it. Raises InstrumentError."""
        settings.bias_off(self._link)

    def estimated_seconds(self, plan: SweepPlan) -> float:
        """Return the seconds that `plan` will take. Raises PlanError where an E4990A cannot do it."""
        self._check(plan)
        return CAPABILITIES.seconds(plan)

    def measure(
        self,
        plan: SweepPlan,
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> tuple[Sweep, ...]:
        """Carry out `plan`; see `Analyzer.measure`. A joined plan is one segment sweep.

        If a sweep is good but the settings could not be restored, the notes of the Sweep say so; if the bias could not
        be switched off, InstrumentError is raised all the same.
        """
        self._check(plan)
        groups = [plan.segments] if plan.joined else [(segment,) for segment in plan.segments]

        def sweep_all(identity: Identity) -> tuple[Sweep, ...]:
            return tuple(
                self._one(
                    plan, group, identity, _ticks(k, len(groups), self._seconds(plan, group), progress, cancelled)
                )
                for k, group in enumerate(groups, start=1)
            )

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
        """Measure the fixture's `standards`; see `Analyzer.compensate`. There is no adapter to choose."""
        if adapter != "OFF":
            raise InstrumentError(f"compensation: adapter {adapter!r} is not known to this driver; OFF is allowed")

        def tick(passed: float, what: str) -> None:
            if cancelled():
                raise Cancelled(f"the {what} compensation was cancelled; the bias is off")
            whole = compensation.STANDARD_SECONDS
            progress(Progress(min(passed / whole, 1.0), max(whole - passed, 0.0), f"{what} compensation"))

        return self._as_found(lambda who: compensation.measure(self._link, who, standards, prompt, tick))[0]

    def restore(self, stored: Compensation) -> None:
        """Write the arrays of `stored` back to the instrument and switch them on. Raises InstrumentError."""
        self._as_found(lambda identity: compensation.apply(self._link, identity, stored))

    def close(self) -> None:
        """Close the connection to the instrument."""
        self._link.close()

    def _check(self, plan: SweepPlan) -> None:
        """Raise PlanError if `plan` exceeds the capabilities or does not fit into one sweep."""
        CAPABILITIES.check(plan)
        most = CAPABILITIES.points_per_sweep
        for where, segment in named_segments(plan):
            if segment.points > most:
                raise PlanError(f"{where} has {segment.points} points; an E4990A sweeps at most {most} at once")
        if plan.joined:
            together, count = sum(s.points for s in plan.segments), len(plan.segments)
            if together > most or count > CAPABILITIES.segments_per_sweep:
                raise PlanError(
                    f"sweep plan: {count} joined segments have {together} points; an E4990A sweeps at most {most} "
                    f"points in {CAPABILITIES.segments_per_sweep} segments at once"
                )
            if count > 1 and any(s.spacing == "log" for s in plan.segments):
                raise PlanError("sweep plan: a joined segment is logarithmic; those of an E4990A are linear")

    @staticmethod
    def _seconds(plan: SweepPlan, segments: Sequence[Segment]) -> float:
        return CAPABILITIES.points_seconds(plan, np.concatenate([points(s) for s in segments]))

    def _one(
        self, plan: SweepPlan, segments: Sequence[Segment], identity: Identity, tick: Callable[[float], None]
    ) -> Sweep:
        """Return one recording, of one segment or of several joined ones."""
        asked = set_up(self._link, segments, plan)
        before = settings.snapshot(self._link, asked)
        bias_on = bool(settings.query(self._link, settings.BIAS_ON))
        tick(0.0)
        expected = self._seconds(plan, segments)
        raw = sweep(self._link, segments, expected, tick)
        after = settings.snapshot(self._link, asked)
        for name, value in before.items():
            if not settings.SETTINGS[name].agrees(value, after[name]):
                raise InstrumentError(
                    f"{self._link.name}: {settings.SETTINGS[name].words} was {settings.text_of(value)}, is "
                    f"{settings.text_of(after[name])}: changed while the sweep ran; "
                    "was a key pressed at the front panel?"
                )
        corrections = [name for name, s in settings.CORRECTIONS.items() if settings.query(self._link, s)]
        return _record(raw, segments, plan, identity, before, bias_on, corrections, expected)

    def _as_found(self, action: Callable[[Identity], Result]) -> tuple[Result, str]:
        """Do `action`, then restore the instrument; return the result and what could not be restored."""
        identity = self.identify()
        found: dict[str, settings.Value] = {}
        try:
            found = settings.snapshot(self._link)
            result = action(identity)
            if (answer := self._link.ask("*IDN?").strip()) != identity.idn:
                raise InstrumentError(
                    f"{self._link.name}: *IDN? is answered by {replies.quote(answer)} after the sweep; "
                    "the answers are out of step"
                )
        except BaseException as error:
            self._leave_after(error, found)
            raise
        return result, self._leave(found)

    def _leave_after(self, error: BaseException, found: Mapping[str, settings.Value]) -> None:
        """Make the instrument safe after `error`; add to the error what could not be done."""
        self._link.doubt()
        try:
            left = self._leave(found)
        except InstrumentError as second:
            left = str(second)
        if left and isinstance(error, InstrumentError):
            raise type(error)(f"{error}. Besides: {left}") from None
        if left:
            error.add_note(left)

    def _leave(self, found: Mapping[str, settings.Value]) -> str:
        """Switch the bias off and restore the settings; return "", or a sentence on what could not be restored.

        Raises InstrumentError where the bias is not known to be off: this must not be overlooked.
        """
        self._twice(lambda: settings.bias_off(self._link))
        try:
            if found:
                self._twice(lambda: self._give_back(found))
        except InstrumentError as error:
            return f"The instrument could not be left as found: {error}"
        return ""

    def _give_back(self, found: Mapping[str, settings.Value]) -> None:
        """Stop the sweep and restore what differs from `found`, initiation last. Raises InstrumentError."""
        settings.put(self._link, settings.SETTINGS["continuous"], False)
        self._link.ask(":ABOR;*ESR?")
        for _ in range(2):  # one setting may move another: the second pass must confirm all of them
            for name, value in found.items():
                if name != "continuous" and not settings.SETTINGS[name].agrees(
                    value, settings.query(self._link, settings.SETTINGS[name])
                ):
                    header = settings.SETTINGS[name].header
                    self._link.ask(f"{header} {settings.text_of(value)};{header}?")
        for name in (*(n for n in found if n != "continuous"), "continuous"):
            settings.put(self._link, settings.SETTINGS[name], found[name])
        self._link.ask("*CLS;*ESR?")

    def _twice(self, action: Callable[[], None]) -> None:
        """Do `action`; where it fails, try once more on a new connection."""
        try:
            action()
        except InstrumentError:
            self._link.doubt()
            action()


def _ticks(
    number: int,
    count: int,
    expected: float,
    progress: Callable[[Progress], None],
    cancelled: Callable[[], bool],
) -> Callable[[float], None]:
    what = f"sweep {number} of {count}"

    def tick(passed: float) -> None:
        if cancelled():
            raise Cancelled(f"{what} was cancelled after {passed:.0f} s; the bias is off")
        done = (number - 1 + min(passed / max(expected, 1e-9), 1.0)) / count
        progress(Progress(done, (1 - done) * count * expected, what))

    return tick


def _record(
    raw: SweepReadout,
    segments: Sequence[Segment],
    plan: SweepPlan,
    identity: Identity,
    got: Mapping[str, settings.Value],
    bias_on: bool,
    corrections: Sequence[str],
    expected: float,
) -> Sweep:
    """Return the recording: the numbers, and all conditions under which they were taken, as read back."""
    f, z = raw.frequency, raw.impedance
    nonzero = np.where(z == 0, 1e-3, z)
    speed, level = round(float(got["speed"])), float(got["level"])
    point_average = round(float(got["point_average"])) if got["point_averaging"] else 1
    sweep_average = round(float(got["sweep_average"])) if got["sweep_averaging"] else 1
    noise = relative_noise(f, nonzero, speed, level, point_average * sweep_average)
    values: dict[str, Any] = {
        "instrument": identity.idn,
        "model": identity.model,
        "serial": identity.serial,
        "firmware": identity.firmware,
        "resource": identity.name,
        "start_Hz": segments[0].start_Hz,
        "stop_Hz": segments[-1].stop_Hz,
        "points": int(f.size),
        "spacing": segments[0].spacing,
        "direction": "down" if got["direction"] == "DOWN" else "up",
        "oscillator_V": level,
        "oscillator_A": None,
        "bandwidth": speed,
        "point_average": point_average,
        "sweep_average": sweep_average,
        "bias_V": float(got["bias"]) if bias_on else 0.0,
        "sweep_delay_s": 0.0,
        "point_delay_s": 0.0,
        "adapter": CAPABILITIES.adapters["OFF"],
        "compensation": list(corrections),
        "source_ohm": CAPABILITIES.source_ohm,
        "started": raw.started,
        "ended": raw.ended,
        "sweep_seconds": round(raw.seconds, 3),
        "estimated_seconds": round(expected, 3),
        "noise_relative": per_point(noise),
        "accuracy_relative": per_point(relative_accuracy(f, nonzero, speed, level)),
        "gain_accuracy_relative": gain_per_point(gain_accuracy(f, speed)),
    }
    notes: tuple[str, ...] = ()
    if len(segments) > 1:
        del values["spacing"]
        starts = np.cumsum([0, *(s.points for s in segments)]).tolist()
        values |= {
            "sweep_type": "segment",
            "segments": [
                {"start_Hz": s.start_Hz, "stop_Hz": s.stop_Hz, "points": b - a}
                for s, (a, b) in zip(segments, pairwise(starts), strict=True)
            ],
        }
        notes = (f"One recording of {len(segments)} segments, in one segment sweep, whose table was overwritten.",)
    return Sweep(f, z, values, raw.started, notes=notes)
