"""The errors of a pair, which make two recordings differ without any change, and one evidence for all hypotheses.

    ln Z_after = ln(change of Z_before) + noise + instrument + fixture + drift + form of the change + rest

- noise of both recordings; that of the recording before is transformed by the change;
- gain and phase of the analyzer in each, constant or smooth over frequency, within its specification;
- residuals of open and short compensation, different after each clamping;
- a drift of the resonances, together and individually: columns d ln Z/d ln f times smooth functions, real for a shift
  and imaginary for the losses, so that steep flanks are not given too much weight;
- an error of the change's own formula, a smooth fraction of the change: a coil's core, a line's loss;
- of a change in the device of a build: its uncertain constants, and how the discrepancy of its model carries over;
- the rest: an exponentially correlated error that is large where the device is sensitive.

All but noise and rest are columns with a unit normal prior, integrated out exactly. The pair chooses the size of each
part, from grids with prior probabilities; a rest beyond `USUAL_REST` is something else, an unnamed change.
"""

from collections.abc import Callable, Iterator, Sequence
from copy import copy
from dataclasses import replace
from functools import cached_property
from math import log

import numpy as np
from scipy.linalg.lapack import dpotrs

from ....models.base.arrays import Complexes, Impedances, Reals
from ...error_model.point_covariance import Kernel, PointErrors, spread_of_variance
from ...error_model.smooth_basis import smooth
from ..pair import Pair
from ..resonances import Remainder, Resonances, slope_of
from .drift import DRIFTS, Drift, DriftPoint
from .imitation import USUAL_DRIFT, beside, shares_of_drift
from .instrument_errors import InstrumentErrors
from .linearised import Linearised, Outcome
from .pair_sizes import (
    RESTS,
    USUAL,
    USUAL_REST,
    Sizes,
    SizeSearch,
    factorised,
    log_density,
    posterior_of,
    scale_of,
)

_SAME = 1e-9
_SHAPE_LENGTH = 1.0
_FLOOR = 0.5
"""Rest far from resonances, relative to that where a frequency shift moves ln Z by twice as much."""
_FLAT, _STEEP = 3e-3, 3e-4
"""Errors with which a start is sought: of ln Z, and a drift."""
_ONE_IN_TWENTY = 1.645
"""Standard deviations that chance exceeds in one recording of twenty."""


class PairErrors:
    """Quantities common to all hypotheses about a pair."""

    def __init__(
        self,
        pair: Pair,
        resonances: tuple[Resonances, Resonances],
        point: DriftPoint | None = None,
        remainder: Remainder | None = None,
    ) -> None:
        """Take a pair, the resonances of both recordings, where drift is linearised, and what is known of it."""
        self.recorded, self.resonances = pair, resonances
        self._drift = Drift(pair, resonances, point or DriftPoint(), remainder)
        self.pair, self.own, self.slope = self._drift.pair, self._drift.own, self._drift.slope
        u = pair.log_f
        ends = float(u[0]), float(u[-1])
        self.shape = smooth(u, ends, _SHAPE_LENGTH, 4)
        self.instrument = InstrumentErrors(self.pair)
        self._felt = np.sqrt(_FLOOR**2 + np.abs(self.slope) ** 2 / 4)

    @cached_property
    def steepness(self) -> Reals:
        """Error of ln Z by a moderate drift, and a small one where ln Z is flat, shape (N,)."""
        pair, (own, now) = self.recorded, self.resonances
        slopes = [slope_of(pair.frequency, Z, side)[0] for Z, side in ((pair.before, own), (pair.after, now))]
        return np.asarray(np.hypot(_FLAT, _STEEP * np.max(np.abs(slopes), axis=0)), np.float64)

    def nudged(self) -> Iterator[tuple[Impedances, Resonances, float]]:
        """Yield the device with a step in ln frequency, then in ln Q, then in ln strength, of each resonance."""
        return self._drift.nudged()

    def drifted(self, outcome: "Outcome") -> "PairErrors":
        """Return the same with the resonances where they drifted to."""
        return self._at(self._drift.towards(outcome.moved))

    def unsettled(self, uncertain: float) -> "PairErrors":
        """Return the same with drift that may still move by this many half widths of each resonance."""
        made = copy(self)
        vars(made).update(_drift=self._drift.unsettled(uncertain))
        return made

    def from_after(self) -> "PairErrors":
        """Return the same for a device that is bare in the recording after: its resonances are those that drift."""
        return self._at(DriftPoint(after=True))

    def settled(self, outcome: "Outcome") -> bool:
        """Return whether drift is where it was linearised, to a small part of each resonance's width."""
        return self._drift.settled(outcome.moved)

    def as_recorded(self, predicted: Impedances) -> Impedances:
        """Return a prediction, ohm, shape (N,), with the drift of the recording after."""
        return np.asarray(predicted * self.recorded.after / self.pair.after, np.complex128)

    def _at(self, point: DriftPoint) -> "PairErrors":
        known = self._drift.remainder if point.after == self._drift.point.after else None
        return PairErrors(self.recorded, self.resonances, point, known)

    def without(self, held: Sequence[tuple[int, int]]) -> "PairErrors":
        """Return the same without some blocks of points."""
        return self._with(self.recorded.without(held))

    def with_noise(self, after: Reals, before: Reals) -> "PairErrors":
        """Return the same with another noise of both recordings, of ln Z, shapes (N,)."""
        return self._with(replace(self.recorded, noise_after=after, noise_before=before))

    def instead(self, after: Impedances) -> "PairErrors":
        """Return the same with another recording after, ohm, shape (N,); drift is linear about no drift."""
        return PairErrors(replace(self.recorded, after=after), self.resonances)

    def _with(self, pair: Pair) -> "PairErrors":
        return PairErrors(pair, self.resonances, self._drift.point)

    def columns(self, at: Linearised) -> tuple[Complexes, dict[str, slice]]:
        """Return the residual and all columns that are integrated out, shape (N, 1 + P + M), with their kinds."""
        pair = self.pair
        groups: dict[str, Complexes] = {
            "x": at.slopes,
            **self.instrument.columns(at.through),
            **self._drift.columns(at.through, at.each),
        }
        if at.model is not None:
            groups["model"] = at.model
        of_formula = self._of_formula(at)
        groups["shape"], _ = self._beside_sizes(at, of_formula)
        where: dict[str, slice] = {}
        first = 1
        for name, block in groups.items():
            where[name] = slice(first, first + block.shape[1])
            first += block.shape[1]
        r = np.log(pair.after / at.predicted) + at.slopes @ at.x
        r = r + self._drift.so_far(at.through, at.each)
        if at.model is not None and at.offset is not None:
            r = r + at.model @ at.offset
        if at.formula is not None:
            r = r + of_formula @ at.formula
        return np.asarray(np.column_stack([r, *groups.values()]), np.complex128), where

    def _beside_sizes(self, at: Linearised, of_formula: Complexes) -> tuple[Complexes, Reals]:
        """Return the errors of formulas beside the part that sizes imitate, and that part, where they are linear.

        Where the error of a formula is known beyond first order, it is estimated together with the sizes.
        """
        columns, shares = of_formula.copy(), np.zeros((at.x.size, of_formula.shape[1]))
        linear = np.repeat([not exact for exact in at.exact], of_formula.shape[1] // max(len(at.exact), 1))
        if np.any(linear):
            columns[:, linear], shares[:, linear] = beside(of_formula[:, linear], at.slopes, 1 / self.points(at).noise)
        return columns, shares

    def _of_formula(self, at: Linearised) -> Complexes:
        """Return d ln Z / d coefficient of the error of each change's formula, shape (N, K)."""
        made = [part * at.shapes[:, k, None] * self.shape for k in range(at.shapes.shape[1]) for part in (1, 1j)]
        return np.asarray(np.hstack([np.zeros((at.frequency.size, 0), np.complex128), *made]), np.complex128)

    def formula_errors(self, coefficients: Reals) -> Complexes:
        """Return the relative errors of the changes' main sizes over frequency, shape (N, K)."""
        parts = coefficients.reshape(-1, 2, self.shape.shape[1])
        return np.asarray(self.shape @ (parts[:, 0] + 1j * parts[:, 1]).T, np.complex128)

    def points(self, at: Linearised, drift: float = 2e-4) -> PointErrors:
        """Return the noise of each point: of both recordings, and the part of a drift beyond its column."""
        pair, s = self.pair, np.abs(at.through)
        second = np.hypot(self._drift.second_order(at.through, drift), self._drift.uncertain(at.through))
        noise = np.sqrt(pair.noise_after**2 + (s * pair.noise_before) ** 2 + second**2)
        return PointErrors(pair.log_f, noise, self._felt * np.maximum(1.0, s), np.zeros_like(noise))

    def _propagated(self, at: Linearised) -> float:
        """Return ln det of the noise as the changes propagate it, relative to that without a change.

        A device is smooth and noise is not. So the roughness of both recordings is known, whatever lies between them:
        a change that amplifies the noise of the recording before is for that neither better nor worse. Nor is one whose
        fit is not settled yet.
        """
        pair = self.pair
        kept = np.isfinite(pair.noise_after)
        with_change = pair.noise_after**2 + (np.abs(at.through) * pair.noise_before) ** 2
        with_change = with_change + self._drift.uncertain(at.through) ** 2
        without = pair.noise_after**2 + pair.noise_before**2
        return 2 * float(np.sum(np.log(with_change[kept] / without[kept])))

    def outcome(
        self,
        at: Linearised,
        rests: Sequence[float] = tuple(RESTS),
        start: Sizes | None = None,
        rounds: int = 3,
        *,
        colours: bool = False,
    ) -> Outcome:
        """Return the evidence for a hypothesis linearised here; the sizes of errors are chosen in `rounds`.

        `colours`: the correlation of the noise is chosen as well.
        """
        X, where = self.columns(at)
        sought = SizeSearch([self.points(at)], X, where, (rounds, self._propagated(at)))
        best = sought.over_rests(rests, start or Sizes())
        if colours:
            best = sought.over_colours(best, rests)
        total = float(np.logaddexp.reduce(list(best.logs.values())))
        usual = [value for rest, value in best.logs.items() if rest <= USUAL_REST]
        part = float(np.exp(np.logaddexp.reduce(usual) - total)) if usual else 0.0
        return self._finished(at, best.sizes, best.G / best.sizes.noise**2, (X, where), (total, part))

    def _finished(
        self,
        at: Linearised,
        sizes: Sizes,
        G: Reals,
        columns: tuple[Complexes, dict[str, slice]],
        told: tuple[float, float],
    ) -> Outcome:
        X, where = columns
        scale = scale_of(where, sizes, G.shape[0])
        inverse, a = posterior_of(G, scale)
        own = where["x"]
        x = a[own.start - 1 : own.stop - 1]
        covariance = inverse[own.start - 1 : own.stop - 1, own.start - 1 : own.stop - 1]
        share = self.shares(at)
        drift = np.concatenate([a[where[name].start - 1 : where[name].stop - 1] for name in DRIFTS])
        covariance = covariance + USUAL_DRIFT**2 * share @ share.T
        moved = self._drift.moved_by(drift)
        cost = float(G[0, 0] - G[0, 1:] @ a)
        model = a[where["model"].start - 1 : where["model"].stop - 1] if "model" in where else a[:0]
        formula = a[where["shape"].start - 1 : where["shape"].stop - 1]
        _, imitated = self._beside_sizes(at, self._of_formula(at))
        left = X[:, 0] - X[:, 1:] @ a
        return Outcome(
            told[0], told[1], sizes, x, covariance, cost, left, x + share @ drift, moved, model, formula, imitated
        )

    def shares(self, at: Linearised) -> Reals:
        """Return the shift of the coordinates of changes in the device by each column of drift, shape (P, M)."""
        drift = np.asarray(np.hstack(list(self._drift.columns(at.through, at.each).values())), np.complex128)
        return shares_of_drift(drift, at, self.points(at).noise)

    def shortfall(self, at: Linearised, outcome: Outcome) -> float:
        """Return the ln likelihood missing relative to noise and usual errors only, beyond chance."""
        X, where = self.columns(at)
        points = self.points(at)
        numbers = 2 * int(np.count_nonzero(np.isfinite(points.noise)))
        # Less noise than usual is no error, and sizes are known to the steps of their grid only.
        found, usual = outcome.sizes, replace(outcome.sizes.at_most(USUAL), noise=USUAL.noise)
        logs: list[float] = []
        for sizes in (found, usual):
            kernel = Kernel([points], sizes.colour, (sizes.rest, 0.0))
            G = kernel.white([X]).squared() / sizes.noise**2
            if sizes is usual:
                G[0, :] = G[:, 0] = 0.0
            log_det = kernel.log_det + 2 * numbers * log(sizes.noise)
            logs.append(log_density(G, log_det, scale_of(where, sizes, G.shape[0])))
        by_chance = np.sqrt(2 * numbers + numbers**2 * spread_of_variance(numbers / 2) ** 2)
        return float(max(0.0, logs[1] - 0.5 * numbers - logs[0] - 0.5 * _ONE_IN_TWENTY * by_chance))

    def unexplained(self, at: Linearised, outcome: Outcome) -> Complexes:
        """Return the residual of ln Z that neither the changes nor errors of usual sizes describe, shape (N,).

        So what a large error of a change's own formula describes is not explained, nor what a drift of a per cent does.
        """
        X, where = self.columns(at)
        sizes = replace(outcome.sizes.at_most(USUAL), noise=outcome.sizes.noise, colour=outcome.sizes.colour)
        G = Kernel([self.points(at)], sizes.colour, (sizes.rest, 0.0)).white([X]).squared() / sizes.noise**2
        _, a = posterior_of(G, scale_of(where, sizes, G.shape[0]))
        return np.asarray(X[:, 0] - X[:, 1:] @ a, np.complex128)

    def merit(self, near: Linearised, sizes: Sizes) -> Callable[[Impedances], float]:
        """Return chi2 as a function of nearby predictions, with errors integrated out as at this point."""
        at = replace(near, slopes=near.slopes[:, :0], x=near.x[:0], inside=())
        X, where = self.columns(at)
        kernel = Kernel([self.points(at)], sizes.colour, (sizes.rest, 0.0))
        white = kernel.white([X])
        G = white.squared() / sizes.noise**2
        scale = scale_of(where, sizes, G.shape[0])
        c, _ = factorised(G, scale)
        drifted = X[:, 0] - np.log(self.pair.after / near.predicted)

        def chi2(predicted: Impedances) -> float:
            r = np.log(self.pair.after / predicted) + drifted
            own = kernel.white([r[:, None]])
            v = scale * white.times(own)[1:, 0] / sizes.noise**2
            solved, _ = dpotrs(c, v, lower=1)
            value = float(own.squared()[0, 0]) / sizes.noise**2 - float(v @ solved)
            return value if np.isfinite(value) else np.inf

        return chi2

    def quadratic(self, at: Linearised, sizes: Sizes) -> float:
        """Return chi2 at these sizes of the errors, everything else integrated out."""
        X, where = self.columns(at)
        G = Kernel([self.points(at)], sizes.colour, (sizes.rest, 0.0)).white([X]).squared()
        seen = G / sizes.noise**2
        _, a = posterior_of(seen, scale_of(where, sizes, G.shape[0]))
        return float(seen[0, 0] - seen[0, 1:] @ a)
