"""A hypothesis: changes one after the other, from the device to the analyzer; and its fit to a pair."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import log

import numpy as np

from ...models.base.arrays import Complexes, Impedances, Reals
from .another_device import EveryResonance
from .change import TERMINALS
from .device_changes import DeviceChange, NewResonance
from .pair_errors import RESTS, Linearised, Outcome, PairErrors, Sizes
from .resonances import Resonances
from .two_ports import Turned, TwoPort
from .with_build.found_device import Step
from .with_build.model_change import ModelChange

_STEP = 1e-4
_FURTHEST = 1.0
"""Longest step of a coordinate at once, standard deviations of its prior."""
_PLAIN, _MARGINAL = 12, 8
_FEW_RESTS = (0.0, 1e-3, 3e-2)
_PARTS = (1.0, 0.3, 0.0)
"""How far the constants of a build's device are moved towards the pair's; less if more is no better."""
_CLOSE = 1e-3
"""In standard uncertainties: a shorter step ends a fit."""
_IMPOSSIBLE = 1e6
"""Ln odds against a change whose name does not fit its sizes, or none of whose sizes is determined."""
_SIGMAS = 2.5
_UNSEEN = 0.35
"""Relative uncertainty of a change's main size above which the change counts as undetermined."""
_BOUND = 5.0
"""Sizes beyond this many standard deviations of their prior are rejected."""


Change = TwoPort | Turned | DeviceChange | EveryResonance | ModelChange
State = tuple[Impedances, Resonances | None]
"""The impedance (ohm) and its resonances."""


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of changes, in order from the device to the analyzer."""

    changes: tuple[Change, ...]
    constants: Mapping[bool, Reals] = field(default_factory=dict[bool, Reals])
    """Coordinates of the constants of a build's device about which its model is linearised: of that before (False) and
    after (True), each with a unit normal prior."""

    @property
    def log_prior(self) -> float:
        """Ln of its prior odds relative to no change."""
        return sum(log(change.odds) for change in self.changes)

    @property
    def names(self) -> tuple[str, ...]:
        """The effects."""
        return tuple(change.effect for change in self.changes)

    @cached_property
    def slices(self) -> tuple[slice, ...]:
        """Slice of each change's coordinates."""
        ends = np.cumsum([0, *(len(change.sizes) for change in self.changes)])
        return tuple(slice(int(a), int(b)) for a, b in pairwise(ends))

    @property
    def inside(self) -> tuple[int, ...]:
        """Mask of the coordinates of changes in the device."""
        pairs = zip(self.changes, self.slices, strict=True)
        return tuple(k for change, own in pairs if change.where != TERMINALS for k in range(own.start, own.stop))

    @property
    def count(self) -> int:
        """Number of its coordinates."""
        return sum(len(change.sizes) for change in self.changes)

    def values(self, x: Reals, k: int) -> dict[str, float]:
        """Return the sizes of change `k`."""
        own = x[self.slices[k]]
        return {size.name: size.value(float(at)) for size, at in zip(self.changes[k].sizes, own, strict=True)}

    def predict(self, Z: Impedances, frequency: Reals, x: Reals, own: Resonances | None = None) -> Impedances:
        """Return the impedance after the changes, ohm, shape (N,), from Z before with its resonances `own`."""
        return self.states((Z, own), frequency, x)[-1][0]

    def states(self, state: State, frequency: Reals, x: Reals, first: int = 0) -> list[State]:
        """Return the impedance before change `first`, and after it and each further one, shape (K - first + 1)."""
        made = [state]
        for k, change in enumerate(self.changes[first:], first):
            seen, own = made[-1]
            if isinstance(change, TwoPort | Turned):
                made.append((change.apply(seen, frequency, self.values(x, k)), own))
            elif isinstance(change, ModelChange):
                drifted = own or change.found.resonances
                constants = self.constants.get(change.taken)
                made.append((change.act(seen, drifted, frequency, self._together(x, k), constants), own))
            else:
                made.append(change.act(seen, own or change.resonances, frequency, self.values(x, k)))
        return made

    def _together(self, x: Reals, k: int) -> tuple[Step, ...]:
        """Return change `k` of a build's device, after those that act on the same device before it."""
        last = self.changes[k]
        return tuple(
            Step(one.apply, self.values(x, j), one.before)
            for j, one in enumerate(self.changes[: k + 1])
            if isinstance(one, ModelChange) and isinstance(last, ModelChange) and one.found is last.found
        )

    def _model_errors(self, frequency: Reals, x: Reals) -> dict[bool, tuple[Complexes, int]]:
        """Return errors of ln Z after by the model of the device before and after, and how many are of constants."""
        last = {one.taken: (k, one) for k, one in enumerate(self.changes) if isinstance(one, ModelChange)}
        return {
            taken: change.errors(frequency, self._together(x, k), self.constants.get(taken))
            for taken, (k, change) in last.items()
        }

    def _with_model(self, at: Linearised) -> Linearised:
        """Return the same with the errors of the model of a build's device."""
        errors = self._model_errors(at.frequency, at.x)
        if not errors:
            return at
        offsets: list[Reals] = []
        for taken, (columns, count) in errors.items():
            own = np.zeros(columns.shape[1])
            own[:count] = self.constants.get(taken, 0.0)
            offsets.append(own)
        return replace(at, model=np.hstack([columns for columns, _ in errors.values()]), offset=np.concatenate(offsets))

    def recentred(self, at: Linearised, outcome: Outcome, part: float) -> "Hypothesis":
        """Return the same with the constants of a build's device moved by this part of the way to the pair's."""
        constants: dict[bool, Reals] = {}
        first = 0
        for taken, (columns, count) in self._model_errors(at.frequency, at.x).items():
            here = self.constants.get(taken, np.zeros(count))
            there = np.clip(outcome.model[first : first + count], -_BOUND, _BOUND)
            constants[taken] = here + part * (there - here)
            first += columns.shape[1]
        return Hypothesis(self.changes, constants)

    def linearised(self, errors: PairErrors, x: Reals, *, drift: bool = True) -> Linearised:
        """Return the prediction at `x` with its derivatives; `drift`: for changes in the device, include its drift."""
        f, Z = errors.pair.frequency, errors.pair.before
        own = errors.own
        states = self.states((Z, own), f, x)
        seen = states[-1][0]
        slopes = np.empty((f.size, x.size), np.complex128)
        for first, part in enumerate(self.slices):
            for k in range(part.start, part.stop):
                moved = x.copy()
                moved[k] += _STEP
                slopes[:, k] = np.log(self.states(states[first], f, moved, first)[-1][0] / seen) / _STEP
        through = np.log(self.predict(Z * (1 + _STEP), f, x, own) / seen) / np.log(1 + _STEP) if self.changes else Z / Z
        each = None
        if drift and self.inside and own.poles.size:
            rows = [np.log(self.predict(Zk, f, x, now) / seen) / step for Zk, now, step in errors.nudged()]
            each = np.asarray(np.column_stack(rows), np.complex128)
        made = Linearised(
            seen,
            np.asarray(through, np.complex128),
            slopes,
            self._shapes(slopes, x),
            x,
            self.inside,
            f,
            each,
        )
        return self._with_model(made) if drift else made

    def _shapes(self, slopes: Complexes, x: Reals) -> Complexes:
        """Return d ln Z / d ln of each change's main size, shape (N, K)."""
        columns = [
            slopes[:, own.start] * (x[own.start] if change.sizes[0].signed else 1 / change.sizes[0].spread)
            for change, own in zip(self.changes, self.slices, strict=True)
            if change.sizes
        ]
        return np.column_stack(columns) if columns else np.zeros((slopes.shape[0], 0), np.complex128)


@dataclass(frozen=True, eq=False)
class Fitted:
    """A hypothesis with its evidence from the pair."""

    hypothesis: Hypothesis
    x: Reals
    at: Linearised
    outcome: Outcome
    errors: PairErrors
    """With the resonances at their drifted frequencies."""

    @property
    def log_posterior(self) -> float:
        """Ln of evidence times prior odds."""
        return self.weight(1.0)

    def weight(self, coarseness: float) -> float:
        """Return ln of evidence times prior odds if this much ln evidence counts as one nat."""
        against = 0.0 if self.possible else _IMPOSSIBLE
        return self.outcome.log_evidence / coarseness + self.hypothesis.log_prior - against

    @cached_property
    def shortfall(self) -> float:
        """Ln likelihood missing relative to an explanation that leaves only noise and usual errors."""
        return self.errors.shortfall(self.at, self.outcome)

    @cached_property
    def possible(self) -> bool:
        """Whether the name of each change fits its sizes, and its first size is determined."""
        f = self.at.frequency
        return all(self._seen(k) for k in range(len(self.hypothesis.changes))) and all(
            not isinstance(change, TwoPort | NewResonance)
            or change.possible is None
            or change.possible(f, self.hypothesis.values(self.x, k))
            for k, change in enumerate(self.hypothesis.changes)
        )

    def _seen(self, k: int) -> bool:
        change, own = self.hypothesis.changes[k], self.hypothesis.slices[k]
        if not change.sizes:
            return True
        if change.sizes[0].signed:
            sd = np.sqrt(np.maximum(np.diag(self.outcome.covariance)[own], 0.0))
            return bool(np.any(np.abs(self.outcome.total[own]) > _SIGMAS * sd))
        main = slice(own.start, own.start + (change.main if isinstance(change, ModelChange) else 1))
        spreads = np.array([size.spread for size in change.sizes[: main.stop - main.start]])
        relative = spreads[:, None] * self.outcome.covariance[main, main] * spreads
        one = np.ones(spreads.size)
        # of one size, 1/u2; of several, that of their best known combination
        return not spreads.size or float(one @ np.linalg.pinv(relative, hermitian=True) @ one) > _UNSEEN**-2

    def sizes(self, k: int) -> Mapping[str, tuple[float, float, str]]:
        """Return value, standard uncertainty and unit of the sizes of change `k`."""
        change, own = self.hypothesis.changes[k], self.hypothesis.slices[k]
        sd = np.sqrt(np.maximum(np.diag(self.outcome.covariance)[own], 0.0))
        return {
            size.name: (size.value(float(x)), float(abs(size.slope(float(x))) * u), size.unit)
            for size, x, u in zip(change.sizes, self.outcome.total[own], sd, strict=True)
        }


def plain_misfit(hypothesis: Hypothesis, errors: PairErrors, x: Reals, known: tuple[State, int] | None = None) -> float:
    """Return the mean square residual of ln Z with equal weights, by which a start is chosen.

    `known`: the impedance before one of the changes, and the number of that change.
    """
    pair = errors.pair
    state, first = known or ((pair.before, errors.own), 0)
    with np.errstate(all="ignore"):
        r = np.log(pair.after / hypothesis.states(state, pair.frequency, x, first)[-1][0])
    kept = np.isfinite(pair.noise_after)
    value = float(np.mean(np.abs(r[kept]) ** 2))
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
        noise2 = best + pair.noise_after[kept] ** 2 + pair.noise_before[kept] ** 2
        weight = 1 / np.sqrt(np.maximum(noise2, 1e-14))
        r = np.log(pair.after / at.predicted)[kept] * weight
        J = at.slopes[kept] * weight[:, None]
        real = np.vstack([J.real, J.imag])
        H: Reals = real.T @ real
        g: Reals = real.T @ np.concatenate([r.real, r.imag]) - x
        last = best
        for _ in range(4):
            step: Reals = np.asarray(np.linalg.solve(H + np.eye(x.size) + damping * np.diag(np.diag(H)), g), np.float64)
            trial = np.clip(x + step / max(1.0, float(np.max(np.abs(step))) / _FURTHEST), -_BOUND, _BOUND)
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
    best = -np.inf
    for _ in range(2):
        at = hypothesis.linearised(errors, x)
        outcome = errors.outcome(at, _FEW_RESTS, sizes, rounds=0)
        best = max(best, outcome.log_evidence + hypothesis.log_prior)
        move = outcome.x - x
        if x.size:
            x = np.clip(x + move / max(1.0, float(np.max(np.abs(move))) / _FURTHEST), -_BOUND, _BOUND)
    return best, x


def fitted(hypothesis: Hypothesis, errors: PairErrors, x: Reals, sizes: Sizes | None = None) -> Fitted:
    """Return the fit with the error model, starting at `x` with errors of these sizes."""
    rests = tuple(RESTS)
    at = hypothesis.linearised(errors, x)
    outcome = errors.outcome(at, _FEW_RESTS if hypothesis.count else rests, sizes, rounds=1)
    if hypothesis.count:
        for _ in range(_MARGINAL):
            move = outcome.x - x
            sd = np.sqrt(np.maximum(np.diag(outcome.covariance), 1e-18))
            if float(np.max(np.abs(move) / sd)) < 100 * _CLOSE:
                break
            x, at = _downhill(hypothesis, errors, (x, at), move, outcome.sizes)
            outcome = errors.outcome(at, _near(outcome.sizes.rest), outcome.sizes, rounds=1)
    for last in (False, True):
        errors = errors.drifted(outcome)
        if hypothesis.count:
            x = np.clip(outcome.x, -_BOUND, _BOUND) if _small(outcome, x) else x
        tried = rests if last else _near(outcome.sizes.rest)
        hypothesis, at, outcome = _with_constants(hypothesis, errors, (x, at), outcome, tried)
    return Fitted(hypothesis, x, at, outcome, errors)


def _with_constants(
    hypothesis: Hypothesis,
    errors: PairErrors,
    here: tuple[Reals, Linearised],
    outcome: Outcome,
    rests: Sequence[float],
) -> tuple[Hypothesis, Linearised, Outcome]:
    """Return the hypothesis linearised again, with the constants of a build's device as far moved as is of use."""
    x, before = here
    best: tuple[Hypothesis, Linearised, Outcome] | None = None
    for part in _PARTS if before.model is not None else (0.0,):
        trial = hypothesis.recentred(before, outcome, part) if part else hypothesis
        at = trial.linearised(errors, x)
        found = errors.outcome(at, rests, outcome.sizes)
        if best is None or found.log_evidence > best[2].log_evidence:
            best = trial, at, found
        if best[2].log_evidence > outcome.log_evidence:
            break
    if best is None:
        raise ValueError("no parts")
    return best


def _near(rest: float) -> tuple[float, ...]:
    """Return further sizes of a rest worth trying."""
    return tuple(size for size in RESTS if rest / 11 <= size <= rest * 11) if rest else tuple(RESTS)[:3]


def _small(outcome: Outcome, x: Reals) -> bool:
    """Return whether a further step needs no check."""
    return bool(np.all(np.abs(outcome.x - x) < _FURTHEST / 4))


def _downhill(
    hypothesis: Hypothesis, errors: PairErrors, here: tuple[Reals, Linearised], move: Reals, sizes: Sizes
) -> tuple[Reals, Linearised]:
    """Return the end of a step, which is shortened as long as it leads uphill."""
    x, at = here
    chi2 = errors.merit(at, sizes)
    before = chi2(at.predicted) + float(x @ x)
    move = move / max(1.0, float(np.max(np.abs(move))) / _FURTHEST)
    for _ in range(6):
        trial = np.clip(x + move, -_BOUND, _BOUND)
        seen = hypothesis.predict(errors.pair.before, errors.pair.frequency, trial, errors.own)
        if chi2(seen) + float(trial @ trial) < before:
            return trial, hypothesis.linearised(errors, trial)
        move = move / 3
    return x, at
