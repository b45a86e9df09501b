"""What a fitter is: the plug-in interface of the entry point group `pzctl.fitters`."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from ..models.base.arrays import Frequencies, Impedances
from ..models.base.errors import CannotError
from ..models.build import Build
from ..models.sweep import Sweep


class FitError(CannotError):
    """This recording does not determine what was asked of it; the sentence says why."""


class TaskError(FitError):
    """What was asked does not go with the build or the fitter: a name that is not there, a number that cannot be."""

    exit_status = 2


@dataclass(frozen=True)
class Options:
    """How a fitter is to work; one that knows them says so by `takes_options = True`."""

    objective: Literal["log", "thesis", "kt2"] = "log"
    """`log`: noise-weighted ln Z; `thesis`: sum |w dZ|^2; `kt2`: stiffness and coupling by the critical frequencies."""
    uncertainty: Literal["covariance", "profile", "bootstrap"] = "covariance"
    procedure: Literal["joint", "sequential", "frozen"] = "joint"
    """All steps at once; each step with the posterior of the one before; or, as in 2012, earlier constants frozen."""


@dataclass(frozen=True)
class FitTask:
    """What a fitter is given: the transducer, and the recordings of its steps so far."""

    build: Build | None
    """None where nothing is known of the device; only a lumped model can be fitted then."""
    sweeps: Mapping[str, tuple[Sweep, ...]]
    """By step, in gluing order; several sweeps of a step are repeats or further segments."""
    free: tuple[str, ...] | None = None
    """Names (`disk.c33D`, `glue1.thickness`) to free; None frees all that carry an uncertainty."""
    options: Options = Options()


@dataclass(frozen=True)
class Interval:
    """Where a real constant lies with 68.3 % and with 95 %; SI units."""

    p68: tuple[float, float]
    p95: tuple[float, float]


@dataclass(frozen=True)
class Constant:
    """A fitted (or held) constant in SI units with standard uncertainties."""

    re: float
    im: float
    u_re: float | None
    """None where the fitter gives no uncertainty (the thesis's procedure), 0 where the value is held as exact."""
    u_im: float | None
    unit: str
    free: bool = True
    interval_re: Interval | None = None
    """From profile likelihood or bootstrap; None where only the standard uncertainty is known."""
    interval_im: Interval | None = None


@dataclass(frozen=True)
class Share:
    """What makes up a standard uncertainty, each part a standard uncertainty itself; SI units."""

    noise: float
    dimensions: float
    """From thicknesses, area and density: a micrometer and a balance make it smaller."""
    knowledge: float
    """From what data sheets say of the other constants, loads and losses."""
    assumptions: float
    """From values held as exact, at their nominal tolerances. Not contained in `u`."""
    largest: tuple[str, float]
    """The single dimension, piece of knowledge or assumption that gives most, and how much."""
    instrument: float = 0.0
    """From errors of the analyzer's gain and phase, and of what compensation leaves of the fixture."""
    model: float = 0.0
    """From errors of the model: smooth ones of each constant, and scatter that no constant makes."""


@dataclass(frozen=True)
class Budget:
    """The uncertainty budget: its parts squared make `u` squared; only assumptions stand beside it."""

    re: Mapping[str, Share]
    im: Mapping[str, Share]
    tolerances: Mapping[str, float]
    """Standard tolerance taken for each value that is held as exact, SI."""


@dataclass(frozen=True)
class Noise:
    """Relative noise per point, and how it was found."""

    relative: float
    source: str
    """`repeats`, `segment overlap`, `smoothness` or `analyzer accuracy`."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Model impedance of one sweep, for the picture."""

    step: str
    frequency: Frequencies
    measured: Impedances
    start: Impedances
    fitted: Impedances


@dataclass(frozen=True, eq=False)
class FitResult:
    """What a fitter answers: DESIGN's `pzctl fit --json`, and the curves behind it."""

    build: str
    fitter: str
    version: str
    steps: tuple[str, ...]
    noise: Noise
    chi2_per_dof: float
    """Misfit in units of the noise; what the analyzer's own error may account for is taken off."""
    constants: Mapping[str, Constant]
    derived: Mapping[str, Constant]
    correlation: tuple[tuple[str, str, float], ...]
    """Pairs of parameters that the recording hardly separates, strongest first."""
    rms_log_error: float
    converged: bool
    evaluations: int
    seconds: float
    says: tuple[str, ...] = ()
    """What a person must know to read the numbers, a sentence each."""
    curves: tuple[Curve, ...] = field(default=())
    budget: Budget | None = None
    chosen: Mapping[str, Any] | None = None
    """Of a fit by hand: who made it, and what was chosen; nothing else in a result comes from a person."""


class Fitter(Protocol):
    """A fitter. Installed under the entry point group `pzctl.fitters`, as a class without arguments."""

    name: str
    version: str
    summary: str
    """One line for `pzctl fitters`."""

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit. Raises FitError where the recording does not determine what was asked."""
        ...
