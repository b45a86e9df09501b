"""Typed wrapper of NLopt that handles its pitfalls. No other module imports NLopt.

S. G. Johnson, The NLopt nonlinear-optimization package, http://github.com/stevengj/nlopt. Properties of its Python
interface (2.11): `RoundoffLimited` is raised on good answers and loses them, so the best point is kept here; an error
in the objective is raised as itself, as `SystemError` or as a bare `runtime_error`, depending on the algorithm, so it
is remembered, the search stopped and the error raised again; a start outside the bounds gives an empty message; there
is one random seed per process.
"""

import importlib
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

import numpy as np

from ...models.base.arrays import Reals
from ..interface import FitError

_nlopt: Any = importlib.import_module("nlopt")  # it has no types
_TOO_LARGE = 1e30
# Replaces non-finite values: NLopt would take NaN for a round-off problem.

Algorithm: TypeAlias = Literal["CRS2_LM", "ESCH", "DIRECT_L", "MLSL+LBFGS"]
Cost: TypeAlias = Callable[[Reals], float]
Slope: TypeAlias = Callable[[Reals], tuple[float, Reals]]

_NAMES = {"CRS2_LM": "GN_CRS2_LM", "ESCH": "GN_ESCH", "DIRECT_L": "GN_DIRECT_L", "MLSL+LBFGS": "G_MLSL_LDS"}
_LOCAL_TOLERANCE = 1e-4
_ENDS = {1: "success", 2: "stop value", 3: "f tolerance", 4: "x tolerance", 5: "evaluations", 6: "time"}


@dataclass(frozen=True, eq=False)
class NloptResult:
    """Best point of a search."""

    x: Reals
    value: float
    evaluations: int
    ended: str
    """Reason for ending: `f tolerance`, `evaluations`, `time`, `round-off` ..."""


@dataclass(frozen=True, eq=False)
class Box:
    """Names, bounds, and a start inside them."""

    names: tuple[str, ...]
    low: Reals
    high: Reals
    start: Reals

    def check(self) -> None:
        """Raise FitError for invalid bounds or a start outside them, naming the coordinate."""
        for name, low, high, x in zip(self.names, self.low, self.high, self.start, strict=True):
            if not low <= x <= high:
                raise FitError(f"{name} starts at {x:g}; its bounds are {low:g} to {high:g}")


class _Watched:
    """An objective as NLopt calls it, which remembers the best point and the first error."""

    def __init__(self, search: Any, cost: Cost, slope: Slope) -> None:
        self.search, self.cost, self.slope = search, cost, slope
        self.best: tuple[float, Reals] | None = None
        self.error: BaseException | None = None
        self.evaluations = 0

    def __call__(self, x: Reals, gradient: Reals) -> float:
        if self.error is not None:  # CRS2 fills its population before it looks whether it was stopped
            return _TOO_LARGE
        self.evaluations += 1
        try:
            value = self._value(x, gradient)
        except BaseException as error:  # an interrupt, too: it must not vanish in NLopt
            self.error = error
            self.search.force_stop()
            return _TOO_LARGE
        if not math.isfinite(value):
            gradient[:] = 0.0
            return _TOO_LARGE
        if self.best is None or value < self.best[0]:
            self.best = value, x.copy()  # x is NLopt's own buffer
        return value

    def _value(self, x: Reals, gradient: Reals) -> float:
        if gradient.size == 0:
            return self.cost(x)
        value, gradient[:] = self.slope(x)
        if not np.all(np.isfinite(gradient)):
            return math.nan
        return value


def search(
    algorithm: Algorithm, cost: Cost, slope: Slope, box: Box, evaluations: int, seconds: float, seed: int
) -> NloptResult:
    """Return the best point that the algorithm finds inside the box; the same for the same seed.

    `cost` returns the value alone, `slope` value and gradient; the algorithm determines which is called. Raises
    whatever these raise, and FitError for a start outside the box or an objective that is finite nowhere.
    """
    box.check()
    _nlopt.srand(seed)
    optimizer = _nlopt.opt(getattr(_nlopt, _NAMES[algorithm]), box.start.size)
    optimizer.set_lower_bounds(box.low)
    optimizer.set_upper_bounds(box.high)
    watched = _Watched(optimizer, cost, slope)
    optimizer.set_min_objective(watched)
    optimizer.set_maxeval(evaluations)
    optimizer.set_maxtime(seconds)
    if algorithm == "MLSL+LBFGS":
        local = _nlopt.opt(_nlopt.LD_LBFGS, box.start.size)
        local.set_ftol_rel(_LOCAL_TOLERANCE)
        local.set_xtol_rel(_LOCAL_TOLERANCE)
        optimizer.set_local_optimizer(local)
    else:
        optimizer.set_ftol_rel(1e-9)
    ended = _run(optimizer, watched, box.start)
    if watched.best is None:
        raise FitError("the model gives no number anywhere inside the bounds of the search")
    return NloptResult(watched.best[1], watched.best[0], watched.evaluations, ended)


def _run(optimizer: Any, watched: _Watched, start: Reals) -> str:
    """Run NLopt; return the reason for ending. Raises the objective's own error."""
    try:
        optimizer.optimize(start.copy())
        ended = _ENDS.get(int(optimizer.last_optimize_result()), "end")
    except _nlopt.RoundoffLimited:
        ended = "round-off"
    except Exception:
        if watched.error is None and watched.best is None:
            raise
        ended = "failure"
    if watched.error is not None:
        raise watched.error
    return ended
