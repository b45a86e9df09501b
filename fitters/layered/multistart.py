"""Ingredients of a global search: bounds, an objective with increased noise, and the distinct minima found so far.

C. G. E. Boender, A. H. G. Rinnooy Kan, Math. Programming 37 (1987) 59: after n descents that ended in w distinct
minima, w (w + 1)/(n - w - 2) more are expected.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from ...models.base.arrays import Complexes, Reals
from ...models.base.errors import PzctlError
from ...models.sweep import Sweep
from ..engine.descent import chi2_per_point, descend
from ..engine.objective import Objective
from ..engine.parameters.coordinates import Coordinates
from ..engine.recording import Prior, Recording, rms
from .nlopt_wrapper import Box

_COARSE_POINTS, _BLUNT = 160, 0.05
# Number of points of the search objective and its assumed noise: at the true noise the minimum would be extremely
# narrow.
_SAME = 1e-3
# Minima whose curves differ by less, rms of ln Z, count as one.
_DESCRIBED = 1.3
_EVALUATIONS = 100
_ROUGH = 1e-6
_NARROWEST, _WIDEST = np.log(1.5), np.log(10.0)
_LOSSES = np.log(1e-4), np.log(0.3)


@dataclass
class LocalMinimum:
    """A distinct minimum of the search objective."""

    x: Reals
    cost: float
    curves: Complexes
    """ln(Z_model/Z_measured) at all coarse points."""
    found_by: list[str] = field(default_factory=list[str])


@dataclass
class Multistart:
    """The distinct minima found so far."""

    objective: Objective
    box: Box
    minima: list[LocalMinimum] = field(default_factory=list[LocalMinimum])
    """Deepest first."""
    descents: int = 0

    def polish(self, x: Reals, by: str) -> None:
        """Descend from x and record the minimum, found by the algorithm `by`."""
        end = _inside(self.objective, self.box, x)
        self.descents += 1
        try:
            curves = np.concatenate(self.objective.log_ratios(end))
        except (PzctlError, ArithmeticError):
            return
        if not np.all(np.isfinite(curves)):
            return
        for minimum in self.minima:
            if rms(minimum.curves - curves) < _SAME:
                minimum.found_by.append(by)
                return
        cost = float(np.sum(self.objective.residual(end) ** 2)) / 2
        self.minima.append(LocalMinimum(end, cost, curves, [by]))
        self.minima.sort(key=lambda minimum: minimum.cost)

    @property
    def unseen(self) -> float:
        """Expected number of minima not yet found."""
        n, w = self.descents, len(self.minima)
        return w * (w + 1) / (n - w - 2) if n > w + 2 else np.inf

    @property
    def better(self) -> float:
        """Probability that one of them is deeper than all found, assuming that all orders are equally probable."""
        return min(1.0, self.unseen / (len(self.minima) + 1))

    def led_by(self, who: str) -> bool:
        """Return whether this algorithm was the first to find the deepest minimum."""
        return bool(self.minima) and self.minima[0].found_by[0] == who

    def describes(self, recordings: Sequence[Recording]) -> bool:
        """Return whether the deepest minimum, refined at the recordings' own noise, describes all of them to it."""
        if not self.minima:
            return False
        whole = Objective(recordings, self.objective.coordinates, self.objective.priors)
        ratios = whole.log_ratios(descend(whole, self.minima[0].x, _ROUGH).x)
        return all(chi2_per_point(r, ratio) < _DESCRIBED for r, ratio in zip(recordings, ratios, strict=True))


def coarse(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the recordings of the search objective: one per step, with fewer points and increased noise."""
    coarsened: list[Recording] = []
    for step in dict.fromkeys(recording.step for recording in recordings):
        of_step = [recording for recording in recordings if recording.step == step]
        kept = [slice(None, None, max(1, r.sweep.frequency.size // _COARSE_POINTS)) for r in of_step]
        pairs = list(zip(of_step, kept, strict=True))
        frequency, first = np.unique(
            np.concatenate([r.sweep.frequency[every] for r, every in pairs]), return_index=True
        )
        few = Sweep(frequency, np.concatenate([r.sweep.impedance[every] for r, every in pairs])[first])
        coarsened.append(replace(of_step[0], sweep=few, noise=np.zeros(frequency.size), misfit=_BLUNT))
    return coarsened


def costs(objective: Objective) -> tuple[Callable[[Reals], float], Callable[[Reals], tuple[float, Reals]]]:
    """Return functions for half the sum of squares, alone and with its gradient."""

    def slope(x: Reals) -> tuple[float, Reals]:
        r = objective.residual(x)
        return float(r @ r) / 2, np.asarray(objective.jacobian(x).T @ r)

    return objective.cost, slope


def box_of(coordinates: Coordinates, priors: Sequence[Prior]) -> Box:
    """Return the bounds: four standard uncertainties, and at least a factor of 1.5 to either side.

    Losses range from 1e-4 to 0.3, the quality of a passive layer over a factor of ten to either side, a load from zero
    to three times its value.
    """
    x, values = coordinates.x, coordinates.forward(coordinates.x)[0]
    spread = {prior.parameter.removesuffix(".re"): 4 * prior.u / abs(prior.mean) for prior in priors if prior.mean}
    low, high = np.zeros(x.size), np.zeros(x.size)
    for k, name in enumerate(coordinates.free):
        if name.endswith("h33.loss"):
            low[k], high[k] = -1.4, 1.4
        elif name.endswith(".loss"):
            low[k], high[k] = min(_LOSSES[0], x[k]), max(_LOSSES[1], x[k])
        elif name in ("back.z", "front.z"):
            low[k], high[k] = min(0.0, x[k]), max(3.0, x[k])
        else:
            reach = _WIDEST if name.endswith(".q") else np.clip(spread.get(name, 0.0), _NARROWEST, _WIDEST)
            of = name if name in values else f"{name}.re"
            ends = [coordinates.inverse({**values, of: values[of] * np.exp(s * reach)})[k] for s in (-1, 1)]
            low[k], high[k] = min(ends), max(ends)
    return Box(coordinates.free, low, high, x)


def _inside(objective: Objective, box: Box, x: Reals) -> Reals:
    """Return the least-squares minimum reached from x without leaving the box.

    Levenberg-Marquardt is several times faster; only if it leaves the box, a trust-region method repeats the descent.
    """
    free = descend(objective, x, _ROUGH).x
    if np.all((box.low <= free) & (free <= box.high)):
        return free
    margin = 1e-6 * (box.high - box.low)
    result = least_squares(
        objective.residual,
        np.clip(x, box.low + margin, box.high - margin),
        jac=objective.jacobian,
        bounds=(box.low, box.high),
        x_scale="jac",
        ftol=_ROUGH,
        xtol=_ROUGH,
        gtol=_ROUGH,
        max_nfev=_EVALUATIONS,
    )
    return np.asarray(result.x, np.float64)
