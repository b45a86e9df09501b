"""The sizes of the errors of a pair: their prior grids, and the most probable ones for a hypothesis."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cache
from math import log

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotri, dpotrs, dtrtrs

from ....models.base.arrays import Complexes, Reals
from ...error_model.point_covariance import Kernel, PointErrors, in_noise

_RIDGES = (0.0, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2)
_FAR_BELOW = 30.0
"""Further sizes of a rest are skipped once ln evidence is this much below the best."""
USUAL_REST = 3e-4

Grid = dict[float, float]
"""Sizes with their prior probabilities."""
GRIDS: dict[str, Grid] = {
    "noise": {0.6: 0.1, 0.8: 0.2, 1.0: 0.4, 1.25: 0.2, 1.6: 0.1},
    "instrument": {0.3: 0.4, 1.0: 0.47, 3.0: 0.1, 10.0: 0.03},
    "fixture": {0.0: 0.5, 1.0: 0.5},
    "drift": {3e-6: 0.2, 3e-5: 0.2, 1e-4: 0.35, 3e-4: 0.2, 1e-3: 0.05},
    "strength": {3e-6: 0.2, 3e-5: 0.2, 1e-4: 0.35, 3e-4: 0.2, 1e-3: 0.05},
    "wander": {3e-6: 0.3, 3e-5: 0.3, 1e-4: 0.3, 3e-4: 0.1},
    "shape": {3e-3: 0.4, 0.01: 0.3, 0.05: 0.2, 0.2: 0.1},
}
_TRIALS = {name: (np.array(list(grid)), np.log(list(grid.values()))) for name, grid in GRIDS.items()}
"""The sizes on each grid, and ln of their prior probabilities."""
COLOURS: Grid = {0.0: 0.6, 0.3: 0.2, 0.5: 0.12, 0.65: 0.05, 0.8: 0.03}
"""Correlation of the noise of neighbouring points."""
RESTS: Grid = {
    0.0: 0.4, 1e-4: 0.2, 3e-4: 0.15, 1e-3: 0.1, 3e-3: 0.05, 1e-2: 0.03, 3e-2: 0.025, 0.1: 0.02, 0.3: 0.015, 1.0: 0.01,
}  # fmt: skip


@dataclass(frozen=True)
class Sizes:
    """Sizes of the parts of the error."""

    noise: float = 1.0
    """Relative to the estimate from the recordings' smoothness."""
    instrument: float = 1.0
    fixture: float = 1.0
    drift: float = 1e-4
    """Common drift of the frequencies and losses of all resonances."""
    strength: float = 1e-4
    """Common drift of all strengths, a fifth of it. It has a law of its own: two recordings at one temperature may
    differ by how the device is held."""
    wander: float = 3e-5
    """Individual drift of each resonance."""
    shape: float = 0.01
    rest: float = 0.0
    colour: float = 0.0
    """Correlation of the noise of neighbouring points, which smoothness underestimates if it is correlated."""

    @property
    def log_prior(self) -> float:
        """Ln of its probability on the grids."""
        parts = sum(log(grid[getattr(self, name)]) for name, grid in GRIDS.items())
        return parts + log(RESTS[self.rest]) + log(COLOURS[self.colour])

    def neighbours(self) -> "tuple[Sizes, ...]":
        """Return these sizes, and those that differ from them in one size other than of the rest or its colour."""
        others = [
            replace(self, **{name: size})
            for name, grid in GRIDS.items()
            for size in grid
            if size != getattr(self, name)
        ]
        return (self, *others)

    def at_most(self, others: "Sizes") -> "Sizes":
        """Return these sizes, limited to the given ones."""
        return Sizes(**{own.name: min(getattr(self, own.name), getattr(others, own.name)) for own in fields(self)})


USUAL = Sizes(1.0, 1.0, 1.0, 1e-3, 1e-3, 3e-4, 0.05, USUAL_REST, max(COLOURS))
"""The usual errors of two recordings of one device."""


@dataclass(frozen=True, eq=False)
class SizesFound:
    """The most probable sizes, and ln evidence by the size of the rest."""

    value: float
    sizes: Sizes
    G: Reals
    logs: dict[float, float]


class SizeSearch:
    """The search for the sizes of the errors."""

    def __init__(
        self, points: list[PointErrors], X: Complexes, where: dict[str, slice], known: tuple[int, float]
    ) -> None:
        self._points, self._where = points, where
        self._rounds, self._propagated = known
        self._white = in_noise(points, [X])
        self._numbers = 2 * int(np.count_nonzero(np.isfinite(points[0].noise)))

    def over_rests(self, rests: Sequence[float], start: Sizes) -> SizesFound:
        """Return the best sizes with each rest, from that of the start outwards."""
        best: SizesFound | None = None
        logs: dict[float, float] = {}
        for side in _outwards(rests, start.rest):
            for rest in side:
                sizes = replace(best.sizes if best else start, rest=rest)
                trial = self._at(sizes, logs)
                logs[rest] = trial.value
                if best is None or trial.value > best.value:
                    best = trial
                if trial.value < best.value - _FAR_BELOW:
                    break
        if best is None:
            raise ValueError("no rests")
        return best

    def over_colours(self, best: SizesFound, rests: Sequence[float]) -> SizesFound:
        """Return the best sizes with more or less correlated noise, as long as that is better."""
        colours = list(COLOURS)
        first, here = best.sizes.colour, best
        for step in (1, -1):
            while 0 <= (k := colours.index(here.sizes.colour) + step) < len(colours):
                trial = self._at(replace(here.sizes, colour=colours[k]), best.logs)
                if trial.value <= here.value:
                    break
                here = trial
        return best if here.sizes.colour == first else self.over_rests(rests, here.sizes)

    def _at(self, sizes: Sizes, logs: dict[float, float]) -> SizesFound:
        kernel = Kernel(self._points, sizes.colour, (sizes.rest, 0.0))
        G = kernel.whitened(self._white).squared()
        value, sizes = _climbed(G, kernel.log_det - self._propagated, self._where, sizes, (self._numbers, self._rounds))
        return SizesFound(value, sizes, G, logs)


def _outwards(rests: Sequence[float], known: float) -> tuple[Sequence[float], Sequence[float]]:
    """Return the sizes from the known one upwards, then downwards; those far from the best are negligible."""
    return [size for size in rests if size >= known], [size for size in reversed(rests) if size < known]


def _climbed(
    G: Reals, log_det: float, where: dict[str, slice], sizes: Sizes, known: tuple[int, int]
) -> tuple[float, Sizes]:
    """Return the largest density times prior over the sizes of the errors, one after the other, and the sizes there.

    `known`: the number of data, and how often all sizes are tried.
    """
    numbers, rounds = known
    start = log_density(G / sizes.noise**2, log_det, scale_of(where, sizes, G.shape[0]))
    best, tried = start - numbers * log(sizes.noise) + sizes.log_prior, dict[str, Sizes]()
    for _ in range(rounds):
        before = best
        for name, (trials, priors) in _TRIALS.items():
            if (name in where and where[name].start == where[name].stop) or tried.get(name) == sizes:
                continue  # without columns, or nothing else has changed since this one was tried
            scale = scale_of(where, sizes, G.shape[0])
            if name == "noise":
                logs = log_densities(G, log_det, scale, trials) - numbers * np.log(trials)
            else:
                logs = densities_of_group(G / sizes.noise**2, log_det, scale, where[name], trials)
                logs = logs - numbers * log(sizes.noise)
            k = int((logs + priors).argmax())
            best = float(logs[k] + priors[k]) + sizes.log_prior - log(GRIDS[name][getattr(sizes, name)])
            sizes = tried[name] = replace(sizes, **{name: float(trials[k])})
        if best - before < 0.1:
            break
    return best, sizes


def scale_of(where: dict[str, slice], sizes: Sizes, count: int) -> Reals:
    """Return the prior standard deviation of each column's coefficient, without the residual."""
    scale = np.ones(count - 1)
    for name, own in where.items():
        if name in GRIDS:
            scale[own.start - 1 : own.stop - 1] = getattr(sizes, name)
    return scale


def log_density(G: Reals, log_det: float, scale: Reals) -> float:
    """Return ln of the residual's density by the products G of all whitened columns, their coefficients integrated out.

    `scale`: prior standard deviations of the coefficients; `log_det`: of the noise.
    """
    c, v = factorised(G, scale)
    solved, _ = dpotrs(c, v, lower=1)
    return -0.5 * (float(G[0, 0] - v @ solved) + 2 * float(np.sum(np.log(c.diagonal()))) + log_det)


def log_densities(G: Reals, log_det: float, scale: Reals, noise: Reals) -> Reals:
    """Return `log_density` for several sizes of the noise (K).

    `log_det` is that of noise of size 1, and the noise's own determinant is not included. The last entry of the
    Cholesky factor with the residual as last column is the root of what the columns leave of it.
    """
    side = np.append(scale, 1.0)
    S = np.roll(G, -1, (0, 1)) * side * side[:, None] / noise[:, None, None] ** 2
    S.reshape(noise.size, -1)[:, : -1 : side.size + 1] += 1.0
    try:
        roots = np.linalg.cholesky(S).diagonal(0, 1, 2)
    except np.linalg.LinAlgError:  # rounding made one of them indefinite
        return np.array([log_density(G / size**2, log_det, scale) for size in noise])
    return -0.5 * (roots[:, -1] ** 2 + 2 * np.log(roots[:, :-1]).sum(axis=1) + log_det)


def densities_of_group(G: Reals, log_det: float, scale: Reals, group: slice, trials: Reals) -> Reals:
    """Return `log_density` for several prior standard deviations (K) of the coefficients of one group of columns.

    `group`: its place in G. The coefficients of all others are integrated out once: a Schur complement.
    """
    others, inside, across, own = _places(G.shape[0], group.start, group.stop)
    d = scale[others]
    S, beside = G.take(inside) * d * d[:, None], G.take(across) * d
    S.ravel()[:: d.size + 1] += 1.0
    c, failed = dpotrf(S.T, lower=1, overwrite_a=1)
    if failed:
        return _one_by_one(G, log_det, scale, group, trials)
    solved, _ = dtrtrs(c, beside.T, lower=1, overwrite_b=1)
    left = np.asarray(G.take(own) - solved.T @ solved, np.float64)
    T = left * (trials**2)[:, None, None]
    T[:, -1] = left[-1] * trials[:, None]
    T[:, -1, -1] = left[-1, -1]
    T.reshape(trials.size, -1)[:, : -1 : left.shape[0] + 1] += 1.0
    try:
        roots = np.linalg.cholesky(T).diagonal(0, 1, 2)
    except np.linalg.LinAlgError:  # rounding made one of them indefinite
        return _one_by_one(G, log_det, scale, group, trials)
    logs = 2 * np.log(roots[:, :-1]).sum(axis=1) + 2 * float(np.log(c.diagonal()).sum())
    return -0.5 * (roots[:, -1] ** 2 + logs + log_det)


def _one_by_one(G: Reals, log_det: float, scale: Reals, group: slice, trials: Reals) -> Reals:
    """Return the same as `densities_of_group`, each by itself."""
    scales = np.tile(scale, (trials.size, 1))
    scales[:, group.start - 1 : group.stop - 1] = trials[:, None]
    return np.array([log_density(G, log_det, one) for one in scales])


@cache
def _places(count: int, start: int, stop: int) -> tuple[NDArray[np.intp], ...]:
    """Return the coefficients of all columns but those of a group, and where in G, flat, their products are.

    Those among themselves, those with the group and the residual, and the products of the latter, the residual last.
    """
    own, others = np.r_[start:stop, 0], np.r_[1:start, stop:count]
    rows = own[:, None] * count
    return others - 1, others[:, None] * count + others, rows + others, rows + own


def posterior_of(G: Reals, scale: Reals) -> tuple[Reals, Reals]:
    """Return covariance and mean of the columns' coefficients."""
    c, v = factorised(G, scale)
    solved, _ = dpotrs(c, v, lower=1)
    lower, _ = dpotri(c, lower=1)
    inverse = np.tril(lower) + np.tril(lower, -1).T
    return scale[:, None] * inverse * scale, scale * solved


def factorised(G: Reals, scale: Reals) -> tuple[Reals, Reals]:
    """Return the Cholesky factor of the coefficients' precision, in units of their priors, and the right side."""
    S = scale[:, None] * G[1:, 1:] * scale
    diagonal = S.ravel()[:: S.shape[0] + 1]
    diagonal += 1.0
    for ridge in _RIDGES:  # rounding may make a matrix of large numbers indefinite
        diagonal *= 1 + ridge
        c, failed = dpotrf(S, lower=1)
        if not failed:
            return c, scale * G[1:, 0]
    raise np.linalg.LinAlgError("errors of a pair")
