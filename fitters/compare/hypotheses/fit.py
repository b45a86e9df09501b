"""The fit of a hypothesis to a pair: plain least squares for a start, a quick screening, and the error model."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Reals
from ..errors.linearised import Linearised, Outcome
from ..errors.pair_errors import PairErrors
from ..errors.pair_sizes import RESTS, USUAL, Sizes
from .fitted import Fitted
from .hypothesis import BOUND, Hypothesis, State

_FURTHEST = 1.0
"""Longest step of a coordinate at once, standard deviations of its prior."""
_PLAIN, _MARGINAL = 12, 8
_FEW_RESTS = (0.0, 1e-4, 1e-3, 3e-2)
_PARTS = (1.0, 0.3, 0.0)
"""How far the constants of a build's device are moved towards the pair's; less if more is no better."""
_DRIFTED = 8
"""Most linearisations about the drift found so far."""
_CLOSE = 1e-3
"""In standard uncertainties: a shorter step ends a fit."""
_UNCERTAIN = (0.5, 0.2, 0.07, 0.02, 0.0)
"""By how much drift may still move, in half widths of each resonance, in the steps of a fit without a rest."""
_SCREENED = (0.3, 0.1, 0.1)
"""The same in a quick screening."""
_LOST = 5.0
"""chi2 per number at which a fit without a rest is given up."""


def plain_misfit(hypothesis: Hypothesis, errors: PairErrors, x: Reals, known: tuple[State, int] | None = None) -> float:
    """Return the mean square residual of ln Z in units of `steepness`, by which a start is chosen.

    `known`: the impedance before one of the changes, and the number of that change.
    """
    pair = errors.pair
    state, first = known or ((pair.before, errors.own), 0)
    with np.errstate(all="ignore"):
        r = np.log(pair.after / hypothesis.states(state, pair.frequency, x, first)[-1][0])
    kept = np.isfinite(pair.noise_after)
    value = float(np.mean(np.abs(r[kept] / errors.steepness[kept]) ** 2))
    return value if np.isfinite(value) else np.inf


def plain_fit(hypothesis: Hypothesis, errors: PairErrors, x: Reals, steps: int = _PLAIN) -> tuple[float, Reals]:
    """Return the result of plain least squares, with the whole misfit as white noise, and the mean square residual."""
    pair = errors.pair
    kept = np.isfinite(pair.noise_after)
    best, damping = plain_misfit(hypothesis, errors, x), 1e-3
    if hypothesis.count == 0:
        return best, x
    for _ in range(steps):
        at = hypothesis.linearised(errors, x, drift=False)
        noise2 = best * errors.steepness[kept] ** 2 + pair.noise_after[kept] ** 2 + pair.noise_before[kept] ** 2
        weight = 1 / np.sqrt(np.maximum(noise2, 1e-14))
        r = np.log(pair.after / at.predicted)[kept] * weight
        J = at.slopes[kept] * weight[:, None]
        real = np.vstack([J.real, J.imag])
        H: Reals = real.T @ real
        g: Reals = real.T @ np.concatenate([r.real, r.imag]) - x
        last = best
        for _ in range(4):
            step: Reals = np.asarray(np.linalg.solve(H + np.eye(x.size) + damping * np.diag(np.diag(H)), g), np.float64)
            trial = np.clip(x + step / max(1.0, float(np.max(np.abs(step))) / _FURTHEST), -BOUND, BOUND)
            value = plain_misfit(hypothesis, errors, trial)
            if value < best:
                x, best, damping = trial, value, damping / 5
                break
            damping *= 10
        if last - best < 1e-3 * last:
            break
    return best, x


def screened(hypothesis: Hypothesis, errors: PairErrors, x: Reals, sizes: Sizes) -> tuple[float, Reals]:
    """Return an approximate ln posterior of a hypothesis near `x`, with errors of these sizes, and its place."""
    best, place = -np.inf, x
    errors = errors.from_after() if hypothesis.removes else errors
    for uncertain in _SCREENED:
        errors = errors.unsettled(uncertain)
        at = hypothesis.linearised(errors, x)
        outcome = errors.outcome(at, _FEW_RESTS, sizes, rounds=1)
        errors = errors.drifted(outcome)
        value = outcome.log_evidence + hypothesis.log_prior
        if value > best:
            best, place = value, x
        move = outcome.x - x
        if x.size:
            x = np.clip(x + move / max(1.0, float(np.max(np.abs(move))) / _FURTHEST), -BOUND, BOUND)
    return best, place


@dataclass(frozen=True, eq=False)
class _Place:
    """A hypothesis linearised at one place."""

    hypothesis: Hypothesis
    errors: PairErrors
    x: Reals
    at: Linearised
    outcome: Outcome

    @property
    def misfit(self) -> float:
        """chi2 for each number."""
        return self.outcome.cost / (2 * int(np.count_nonzero(np.isfinite(self.errors.pair.noise_after))))


def fitted(hypothesis: Hypothesis, errors: PairErrors, x: Reals, sizes: Sizes | None = None) -> Fitted:
    """Return the fit with the error model, starting at `x` with errors of these sizes.

    A rest, or an error of a formula, takes what is left of a sharp resonance before its drift has been found. So where
    they are unusually large the place is also sought with usual ones, and the more probable one counts.
    """
    start = _approached(hypothesis, errors, x, sizes)
    best = _relinearised(start)
    if best.outcome.sizes != best.outcome.sizes.at_most(USUAL):
        best = max(best, _annealed(start), key=lambda place: place.outcome.log_evidence)
    best = max(_here(best), _moved(best, tuple(RESTS)), key=lambda place: place.outcome.log_evidence)
    return Fitted(best.hypothesis, best.x, best.at, best.outcome, best.errors)


def _here(place: _Place) -> _Place:
    """Return the same place with every size of a rest and every correlation of the noise."""
    outcome = place.errors.outcome(place.at, tuple(RESTS), place.outcome.sizes, colours=True)
    return replace(place, outcome=outcome)


def _approached(hypothesis: Hypothesis, errors: PairErrors, x: Reals, sizes: Sizes | None) -> _Place:
    """Return the place that a few steps of the coordinates lead to, drift being linear."""
    errors = errors.from_after() if hypothesis.removes else errors
    at = hypothesis.linearised(errors, x)
    outcome = errors.outcome(at, _FEW_RESTS if hypothesis.count else tuple(RESTS), sizes, rounds=1)
    for _ in range(_MARGINAL if hypothesis.count else 0):
        move = outcome.x - x
        sd = np.sqrt(np.maximum(np.diag(outcome.covariance), 1e-18))
        if float(np.max(np.abs(move) / sd)) < 100 * _CLOSE:
            break
        x, at = _downhill(hypothesis, errors, (x, at), move, outcome.sizes)
        outcome = errors.outcome(at, _near(outcome.sizes.rest), outcome.sizes, rounds=1)
    return _Place(hypothesis, errors, x, at, outcome)


def _relinearised(place: _Place) -> _Place:
    """Return the most probable place on the way from here, until drift is settled."""
    best: _Place | None = None
    for k in range(_DRIFTED):
        settled = k > 0 and place.errors.settled(place.outcome)
        place = _moved(place, _near(place.outcome.sizes.rest))
        if best is None or place.outcome.log_evidence > best.outcome.log_evidence:
            best = place
        if settled:
            break
    return best or place


def _annealed(place: _Place) -> _Place:
    """Return the place found without a rest, drift being less and less uncertain; this one if that leads nowhere."""
    start = place
    errors = place.errors.unsettled(_UNCERTAIN[0])
    place = replace(place, errors=errors, outcome=errors.outcome(place.at, (0.0,)))
    for uncertain in _UNCERTAIN:
        place = _moved(replace(place, errors=place.errors.unsettled(uncertain)), (0.0,))
        if place.misfit > _LOST:
            return start
    return _relinearised(place)


def _moved(place: _Place, rests: Sequence[float]) -> _Place:
    """Return the place linearised again where it was estimated: coordinates, drift, formulas and constants."""
    before, hypothesis, x = place.outcome, place.hypothesis, place.x
    errors = place.errors.drifted(before)
    if hypothesis.count:
        known = np.zeros_like(before.formula) if place.at.formula is None else place.at.formula
        there = hypothesis.with_formula(errors, before.formula).formula
        aim = before.formula if there is None else there.coefficients
        move = before.x - before.imitated @ aim - x
        part = 1 / max(1.0, 2 * float(np.max(np.abs(move))) / _FURTHEST)
        x = np.clip(x + part * move, -BOUND, BOUND)
        hypothesis = hypothesis.with_formula(errors, known + part * (aim - known))
    trials = _PARTS if place.at.model is not None else (0.0,)
    best: _Place | None = None
    for share in trials:
        trial = hypothesis.recentred(place.at, before, share) if share else hypothesis
        at = trial.linearised(errors, x)
        outcome = errors.outcome(at, rests, before.sizes, colours=len(rests) == len(RESTS))
        if best is None or outcome.log_evidence > best.outcome.log_evidence:
            best = _Place(trial, errors, x, at, outcome)
        if best.outcome.log_evidence > before.log_evidence:
            break
    return best or place


def _near(rest: float) -> tuple[float, ...]:
    """Return further sizes of a rest worth trying."""
    return tuple(size for size in RESTS if rest / 11 <= size <= rest * 11) if rest else tuple(RESTS)[:3]


def _downhill(
    hypothesis: Hypothesis, errors: PairErrors, here: tuple[Reals, Linearised], move: Reals, sizes: Sizes
) -> tuple[Reals, Linearised]:
    """Return the end of a step, which is shortened as long as it leads uphill."""
    x, at = here
    chi2 = errors.merit(at, sizes)
    before = chi2(at.predicted) + float(x @ x)
    move = move / max(1.0, float(np.max(np.abs(move))) / _FURTHEST)
    for _ in range(6):
        trial = np.clip(x + move, -BOUND, BOUND)
        seen = hypothesis.predict(errors.pair.before, errors.pair.frequency, trial, errors.own)
        if chi2(seen) + float(trial @ trial) < before:
            return trial, hypothesis.linearised(errors, trial)
        move = move / 3
    return x, at
