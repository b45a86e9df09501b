"""The interface of an analyzer, which is an instrument, a simulated one, or a recording that is played back."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Literal, Protocol, runtime_checkable

from ...models.base.errors import PzctlError
from ...models.sweep import Sweep
from ...models.sweep_plan import SweepPlan
from .capabilities import Capabilities
from .compensation import Compensation, Standard


class InstrumentError(PzctlError):
    """The instrument, or the connection to it, failed."""


class Cancelled(InstrumentError):
    """The measurement was cancelled; the instrument is in HOLD with its bias off."""


@dataclass(frozen=True)
class Identity:
    """The identity of an analyzer."""

    name: str
    """Its name for people: the resource string."""
    idn: str
    """The answer to `*IDN?`."""
    model: str
    serial: str
    firmware: str


@dataclass(frozen=True)
class Progress:
    """The progress of a measurement."""

    fraction: float
    """0 to 1."""
    seconds_left: float
    what: str
    """The current activity in a few words: `sweep 1 of 2`."""


class Analyzer(Protocol):
    """An impedance analyzer, used by one thread at a time. Methods with a body here are defaults for most analyzers."""

    def identify(self) -> Identity:
        """Return the instrument's identity. Raises InstrumentError if the answer is not that of this analyzer."""
        ...

    @property
    def capabilities(self) -> Capabilities:
        """Its capabilities, known without asking the instrument."""
        ...

    def make_safe(self) -> None:
        """Switch the bias off. Raises InstrumentError if it stays on."""
        ...

    def estimated_seconds(self, plan: SweepPlan) -> float:
        """Estimate the seconds of a plan without asking the instrument. Raises PlanError if it cannot do the plan."""
        self.capabilities.check(plan)
        return self.capabilities.seconds(plan)

    def measure(
        self,
        plan: SweepPlan,
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> tuple[Sweep, ...]:
        """Carry out the plan; return one Sweep per segment, in order, or a single one if the plan joins them.

        Raises PlanError before anything is sent, Cancelled, or InstrumentError. In any case the bias is off afterwards
        and the instrument has its previous settings.
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
        """Measure the fixture's `standards`, each after `prompt` has asked a person to connect it and returned.

        The instrument corrects every later sweep by them; the arrays are returned to be kept. `adapter` is one of
        `Capabilities.adapters`. Raises InstrumentError if a reading does not fit its standard, or if the analyzer has
        no compensation (the default); Cancelled; and what `prompt` raises.
        """
        raise InstrumentError(f"a {self.capabilities.model} has no compensation that pzctl can measure")

    def restore(self, stored: Compensation) -> None:
        """Load the arrays of `stored` into the instrument and switch them on. Raises InstrumentError."""
        raise InstrumentError(f"a {self.capabilities.model} has no compensation that pzctl can restore")

    def close(self) -> None:
        """Close the connection to the instrument."""
        ...


FileKind = Literal["screen", "ascii", "binary", "touchstone"]


@runtime_checkable
class MakesFiles(Protocol):
    """An analyzer that can make files of its screen and of the sweep shown."""

    def fetch(self, kind: FileKind) -> bytes:
        """Return the content of a file that the instrument makes. Raises InstrumentError.

        `screen` is a TIFF of the screen; `ascii`, `binary` and `touchstone` are the sweep shown, in its own formats.
        """
        ...


@runtime_checkable
class OnALine(Protocol):
    """An analyzer behind a connection that a short sweep can test, unlike a recording."""

    @property
    def hears_requests(self) -> bool:
        """Whether a service request signals the end of a sweep; otherwise the instrument is polled."""
        ...
