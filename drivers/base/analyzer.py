"""What every analyzer can do, whether it is an instrument, a simulated one, or a recording that is played."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from ...models.base.errors import PzctlError
from ...models.sweep import Sweep
from ...models.sweep_plan import SweepPlan
from .capabilities import Capabilities
from .compensation import Compensation, Standard


class InstrumentError(PzctlError):
    """The instrument, or the way to it, does not do what was asked."""


class Cancelled(InstrumentError):
    """The measurement was cancelled; the instrument is in HOLD with its bias off."""


@dataclass(frozen=True)
class Identity:
    """Who answered."""

    name: str
    """What people call it: the resource string."""
    idn: str
    """The answer to `*IDN?`."""
    model: str
    serial: str
    firmware: str


@dataclass(frozen=True)
class Progress:
    """How far a measurement is."""

    fraction: float
    """0 to 1."""
    seconds_left: float
    what: str
    """A few words: `sweep 1 of 2`."""


class Analyzer(Protocol):
    """An impedance analyzer. One thread at a time. What has a body here is what most do; the rest is each one's own."""

    def identify(self) -> Identity:
        """Ask who is there. Raises InstrumentError where the answer is not of this analyzer."""
        ...

    @property
    def capabilities(self) -> Capabilities:
        """What it can do; nothing is asked of it for this."""
        ...

    def make_safe(self) -> None:
        """Switch the bias off, whoever left it on. Raises InstrumentError where it stays on."""
        ...

    def estimated_seconds(self, plan: SweepPlan) -> float:
        """Return how long the plan will take, asking the instrument nothing. Raises PlanError where it cannot do it."""
        self.capabilities.check(plan)
        return self.capabilities.seconds(plan)

    def measure(
        self,
        plan: SweepPlan,
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> tuple[Sweep, ...]:
        """Carry out the plan: one Sweep for each segment, in order; a single one where the plan joins them.

        Raises PlanError before anything is sent, Cancelled, or InstrumentError. On every way out the bias is off
        and the instrument is left as found.
        """
        ...

    def compensate(
        self,
        standards: Sequence[Standard],
        prompt: Callable[[str], None],
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
        adapter: str = "OFF",
    ) -> Compensation:
        """Measure the fixture's `standards`, each after `prompt` has returned from asking a person to put it in.

        The instrument corrects every later sweep by them; the arrays are returned to be kept. `adapter`: one of
        `Capabilities.adapters`. Raises InstrumentError where a standard is not what it should be, or there is no
        fixture, Cancelled, and what `prompt` raises. Unless overridden, there is none.
        """
        raise InstrumentError(f"a {self.capabilities.model} has no compensation that pzctl can measure")

    def restore(self, stored: Compensation) -> None:
        """Give the instrument the arrays of `stored` again, and switch them on. Raises InstrumentError."""
        raise InstrumentError(f"a {self.capabilities.model} has no compensation that pzctl can give back")

    def close(self) -> None:
        """Let go of the instrument."""
        ...


FileKind = Literal["screen", "ascii", "binary", "touchstone"]


@runtime_checkable
class MakesFiles(Protocol):
    """An analyzer that makes files of what it shows; not every one does."""

    def fetch(self, kind: FileKind) -> bytes:
        """Return a file that the instrument makes. Raises InstrumentError.

        `screen`: a TIFF of what it shows; `ascii`, `binary`, `touchstone`: the sweep it shows, in its own formats.
        """
        ...


@runtime_checkable
class OnALine(Protocol):
    """An analyzer at the other end of a line, which a short sweep tries; a recording has none."""

    @property
    def hears_requests(self) -> bool:
        """Whether the end of a sweep is told by service request; else the instrument is asked for it."""
        ...
