"""A hypothesis: changes one after the other, from the device to the analyzer; and its fit to a pair."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import pairwise
from math import log
from typing import Any

import numpy as np

from ....models.base.arrays import Complexes, Impedances, Reals
from ..change import TERMINALS
from ..errors.linearised import Linearised, Outcome
from ..errors.pair_errors import PairErrors
from ..known_changes.another_device import EveryResonance
from ..known_changes.device_changes import DeviceChange, NewResonance
from ..known_changes.two_ports import Turned, TwoPort
from ..levels.drive_levels import AmplitudeDependent
from ..resonances import Resonances
from ..with_build.found_device import Step
from ..with_build.model_change import ModelChange

_STEP = 1e-4
BOUND = 5.0
"""Sizes beyond this many standard deviations of their prior are rejected."""


Change = TwoPort | Turned | DeviceChange | EveryResonance | ModelChange
State = tuple[Impedances, Resonances | None]
"""The impedance (ohm) and its resonances."""


@dataclass(frozen=True, eq=False)
class FormulaErrors:
    """Errors of the changes' formulas: smooth relative errors of their main sizes over frequency."""

    coefficients: Reals
    """With unit functions, shape (K B 2,): of each change, the real parts, then the imaginary parts."""
    curves: Complexes
    """Shape (N, K)."""


def exact(change: Change) -> bool:
    """Return whether an error of a change's formula is computed exactly: a two-port whose main size is positive."""
    return isinstance(change, TwoPort) and bool(change.sizes) and not change.sizes[0].signed


@dataclass(frozen=True, eq=False)
class Hypothesis:
    """A set of changes, in order from the device to the analyzer."""

    changes: tuple[Change, ...]
    constants: Mapping[bool, Reals] = field(default_factory=dict[bool, Reals])
    """Coordinates of the constants of a build's device about which its model is linearised: of that before (False) and
    after (True), each with a unit normal prior."""
    formula: "FormulaErrors | None" = None
    """Errors of the changes' formulas about which they are linearised; None for none."""

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
        """Coordinates of changes in the device that drift can imitate: not of a resonance that bends or is new."""
        pairs = zip(self.changes, self.slices, strict=True)
        return tuple(
            k
            for change, own in pairs
            if change.where != TERMINALS and not isinstance(change, AmplitudeDependent | NewResonance)
            for k in range(own.start, own.stop)
        )

    @property
    def removes(self) -> bool:
        """Whether the device is bare afterwards and was not before: every change is an element that was removed."""
        return bool(self.changes) and all(isinstance(one, TwoPort) and one.taken for one in self.changes)

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
                made.append((change.apply(seen, frequency, self._over_frequency(x, k)), own))
            elif isinstance(change, ModelChange):
                drifted = own or change.found.resonances
                constants = self.constants.get(change.taken)
                made.append((change.act(seen, drifted, frequency, self._together(x, k), constants), own))
            else:
                made.append(change.act(seen, own or change.resonances, frequency, self.values(x, k)))
        return made

    def _over_frequency(self, x: Reals, k: int) -> Mapping[str, Any]:
        """Return the sizes of change `k`, the main one with the error of its formula: complex, shape (N,)."""
        values: dict[str, Any] = dict(self.values(x, k))
        if self.formula is not None and exact(self.changes[k]):
            main = self.changes[k].sizes[0].name
            values[main] = values[main] * np.exp(self.formula.curves[:, self._sized.index(k)])
        return values

    @cached_property
    def _sized(self) -> tuple[int, ...]:
        """Numbers of the changes that have sizes."""
        return tuple(k for k, change in enumerate(self.changes) if change.sizes)

    def with_formula(self, errors: PairErrors, coefficients: Reals) -> "Hypothesis":
        """Return the same with these errors of the changes' formulas where they are known beyond first order."""
        each = coefficients.reshape(len(self._sized), -1).copy() if self._sized else coefficients
        for row, k in enumerate(self._sized):
            if not exact(self.changes[k]):
                each[row] = 0.0
        return replace(self, formula=FormulaErrors(each.ravel(), errors.formula_errors(each.ravel())))

    def without(self, k: int) -> "Hypothesis":
        """Return the same without change `k`."""
        others = tuple(one for j, one in enumerate(self.changes) if j != k)
        formula = self.formula
        if formula is not None and k in self._sized:
            row = self._sized.index(k)
            rows = np.delete(formula.coefficients.reshape(len(self._sized), -1), row, axis=0)
            formula = FormulaErrors(rows.ravel(), np.delete(formula.curves, row, axis=1))
        return Hypothesis(others, self.constants, formula)

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
            there = np.clip(outcome.model[first : first + count], -BOUND, BOUND)
            constants[taken] = here + part * (there - here)
            first += columns.shape[1]
        return replace(self, constants=constants)

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
        if drift and any(one.where != TERMINALS for one in self.changes) and own.poles.size:
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
            formula=None if self.formula is None else self.formula.coefficients,
            exact=tuple(exact(self.changes[k]) for k in self._sized),
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
