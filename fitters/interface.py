"""Plug-in interface of fitters, entry point group `pzctl.fitters`."""

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

import numpy as np

from ..models.base.arrays import Frequencies, Impedances
from ..models.base.errors import CannotError, PzctlError
from ..models.build import Build
from ..models.sweep import Sweep


class FitError(CannotError):
    """The recording does not determine the constants; the message says why."""


class TaskError(FitError):
    """The request does not match the build or the fitter: an unknown name, or an impossible number."""

    exit_status = 2


UNCOMPUTABLE = (PzctlError, ArithmeticError, np.linalg.LinAlgError)
"""What a fit raises that cannot be computed: constants of no material, an overflow, singular equations. A search tries
the next one."""


@dataclass(frozen=True)
class Options:
    """Options of a fit; a fitter that supports them has `takes_options = True`."""

    objective: Literal["log", "thesis", "kt2"] = "log"
    """`log`: noise-weighted ln Z; `thesis`: sum |w dZ|^2; `kt2`: stiffness and coupling from the critical
    frequencies."""
    uncertainty: Literal["covariance", "profile", "bootstrap"] = "covariance"
    procedure: Literal["joint", "sequential", "frozen"] = "joint"
    """All steps at once; each step with the posterior of the one before; or, as in 2012, earlier constants frozen."""


@dataclass(frozen=True)
class FitTask:
    """Input of a fitter: the transducer, and the recordings of its steps so far."""

    build: Build | None
    """None if nothing is known of the device; only a lumped model can be fitted then."""
    sweeps: Mapping[str, tuple[Sweep, ...]]
    """By step, in gluing order; several sweeps of a step are repeats or further segments."""
    free: tuple[str, ...] | None = None
    """Names (`disk.c33D`, `glue1.thickness`) to free; None frees all that have an uncertainty."""
    options: Options = Options()


@dataclass(frozen=True)
class Interval:
    """68.3 % and 95 % intervals of a real constant; SI units."""

    p68: tuple[float, float]
    p95: tuple[float, float]


@dataclass(frozen=True)
class Constant:
    """A fitted (or held) constant in SI units with standard uncertainties."""

    re: float
    im: float
    u_re: float | None
    """None if the fitter gives no uncertainty (the thesis's procedure), 0 if the value is held as exact."""
    u_im: float | None
    unit: str
    free: bool = True
    interval_re: Interval | None = None
    """From profile likelihood or bootstrap; None if only the standard uncertainty is known."""
    interval_im: Interval | None = None
    u_by: Mapping[str, float] | None = None
    """Parts of `u_re` by source (`noise`, `instrument`, `model`, `dimensions`), whose squares add up to its square.

    Of a diagnosis; None if it is not split. A fit has a `Budget`.
    """
    u_by_im: Mapping[str, float] | None = None
    """The same of `u_im`."""

    def quantity(self, registry: Any) -> Any:
        """Return the value as a quantity of a Pint registry, complex if it has an imaginary part.

        `constant.quantity(pint.UnitRegistry()).to("GPa")`.
        """
        value = complex(self.re, self.im) if self.im else self.re
        unit = re.sub(r"(?<=m)([23])", r"**\1", self.unit.replace("Rayl", "Pa*s/m"))
        return registry.Quantity(value, "" if unit == "1" else unit)


_MOST_Q = 1e6
"""Quality factor beyond that of all layers of a transducer: a fit that ends above it has found no losses at all."""


def is_undetermined(name: str, constant: Constant) -> bool:
    """Return whether a constant is a quality factor without an upper end, which the recording does not determine."""
    return name.endswith(".q") and constant.free and constant.re > _MOST_Q


@dataclass(frozen=True)
class Share:
    """Contributions to a standard uncertainty, each a standard uncertainty itself; SI units."""

    noise: float
    dimensions: float
    """From thicknesses, area and density: a better micrometer or balance reduces it."""
    knowledge: float
    """From the priors of the other constants, loads and losses."""
    assumptions: float
    """From values held as exact, at their nominal tolerances. Not included in `u`."""
    largest: tuple[str, float]
    """The single largest dimension, prior or assumption, and its contribution."""
    instrument: float = 0.0
    """From errors of the analyzer's gain and phase, and the residual of the fixture's compensation."""
    model: float = 0.0
    """From errors of the model: smooth ones of each constant, and scatter that no constant causes."""


@dataclass(frozen=True)
class Budget:
    """Uncertainty budget: the squares of its parts, except assumptions, add up to `u` squared."""

    re: Mapping[str, Share]
    im: Mapping[str, Share]
    tolerances: Mapping[str, float]
    """Standard tolerance assumed for each value that is held as exact, SI."""


@dataclass(frozen=True)
class Noise:
    """Relative noise per point, and its source."""

    relative: float
    source: str
    """`repeats`, `segment overlap`, `smoothness` or `analyzer accuracy`."""


@dataclass(frozen=True, eq=False)
class Curve:
    """Measured and modelled impedance of one sweep, for figures."""

    step: str
    frequency: Frequencies
    measured: Impedances
    start: Impedances
    fitted: Impedances
    explained: Impedances | None = None
    """The fit with the most probable errors of instrument and device too, if there are any."""


@dataclass(frozen=True, eq=False)
class FitResult:
    """Result of a fitter: the content of `pzctl fit --json`, and its curves."""

    build: str
    fitter: str
    version: str
    steps: tuple[str, ...]
    noise: Noise
    chi2_per_dof: float
    """Misfit in units of the noise, without the part that the analyzer's own error accounts for."""
    constants: Mapping[str, Constant]
    derived: Mapping[str, Constant]
    correlation: tuple[tuple[str, str, float], ...]
    """Pairs of parameters that the recording hardly separates, strongest first."""
    rms_log_error: float
    converged: bool
    evaluations: int
    seconds: float
    says: tuple[str, ...] = ()
    """Sentences that a person must know to read the numbers."""
    curves: tuple[Curve, ...] = field(default=())
    budget: Budget | None = None
    chosen: Mapping[str, Any] | None = None
    """Of a fit by hand: its author and choices; nothing else in a result comes from a person."""


class Fitter(Protocol):
    """A fitter. Installed under the entry point group `pzctl.fitters`, as a class without arguments."""

    name: str
    version: str
    summary: str
    """One line for `pzctl fitters`."""

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the task. Raises FitError if the recording does not determine the constants."""
        ...
