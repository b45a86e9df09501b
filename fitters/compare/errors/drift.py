"""The drift of a device's resonances between two recordings, together and each by itself.

A device drifts as it is when nothing is between it and the analyzer. So its resonances are those of the recording that
shows it bare: that before, or that after if something was removed. Drift is linearised about what has been found of it.
"""

from collections.abc import Callable, Iterator
from copy import copy
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from ....models.base.arrays import Complexes, Impedances, Reals
from ...error_model.smooth_basis import smooth
from ..pair import Pair
from ..resonances import Remainder, Resonances, changed, pole_terms, remainder_of, slope_of

_STEP = 1e-6
_LENGTH, _LOSSES = 0.1, 0.3
"""Resonances further apart than this in ln f drift independently; drift of 1/(2 Q) relative to that of ln f."""
_DAMPING = 100.0
"""Smallest drift of ln Q relative to that of ln f: one per cent beside 1e-4."""
STRENGTH = 5.0
"""Common drift of ln strength relative to that of ln f: permittivity depends on temperature more than stiffness."""
_TOGETHER = np.array([1.0, 1.0, STRENGTH])
"""Common drift of ln frequency, ln Q and ln strength, relative to that of each resonance by itself."""
DRIFTS = "drift", "strength", "wander"
"""The kinds of columns of `Drift.columns`, in their order."""
_FURTHEST = 2e-3
"""Largest drift about which errors are linearised; a larger shift is not drift."""
_SETTLED, _STRIDE = 0.02, 0.7
"""Of a drift's linearisation: the step, in half widths of the resonance, that ends it, and the largest one."""


def _none() -> Reals:
    return np.zeros(0)


@dataclass(frozen=True, eq=False)
class DriftPoint:
    """Where drift is linearised."""

    moved: Reals = field(default_factory=_none)
    """Drift of each resonance in ln frequency, then in ln Q, then in ln strength, shape (3P,); empty for none."""
    uncertain: float = 0.0
    """By how much each may still move, in half widths, during a fit."""
    after: bool = False
    """Whether the device is bare in the recording after."""


class Drift:
    """The drift of the resonances of one recording of a pair."""

    def __init__(
        self,
        pair: Pair,
        resonances: tuple[Resonances, Resonances],
        point: DriftPoint,
        remainder: Remainder | None = None,
    ) -> None:
        """Take a pair, the resonances of both recordings, and where drift is linearised.

        `remainder`: what the resonances leave of the same recording, if it is known.
        """
        own = resonances[point.after]
        count = own.poles.size
        self.point = point if point.moved.size else replace(point, moved=np.zeros(3 * count))
        self.pair, self.own = pair, own
        if np.any(self.point.moved):
            self.pair, self.own = self._applied(pair, own)
        f, u = pair.frequency, pair.log_f
        self._Y: Complexes = np.asarray(1 / (self.pair.after if point.after else self.pair.before), np.complex128)
        self.remainder = remainder or remainder_of(f, self._Y, self.own)
        self.slope, rest, self._slope_error = slope_of(f, 1 / self._Y, self.own, self.remainder)
        self._bend = np.gradient(rest, u)
        self._each = self._of_each()
        ends = float(u[0]), float(u[-1])
        span = max(ends[1] - ends[0], 1e-6)
        varying = self._varying(rest, lambda at: smooth(at, ends, max(_LENGTH, span / 12), 10))
        self._rest = rest[:, None], np.hstack([varying, 1j * _LOSSES * varying])

    def _applied(self, pair: Pair, own: Resonances) -> tuple[Pair, Resonances]:
        """Return the pair as if the device of the recording before were that of the recording after."""
        f, moved = pair.frequency, -self.point.moved if self.point.after else self.point.moved
        now = Resonances(*changed(own.poles, own.residues, *np.split(moved, 3)))
        difference = np.sum(now.seen(f) - own.seen(f), axis=1)
        if self.point.after:
            return replace(pair, after=1 / (1 / pair.after + difference)), now
        return replace(pair, before=1 / (1 / pair.before + difference)), now

    @property
    def _unit(self) -> Reals:
        """Drift of each resonance in ln frequency, ln Q and ln strength for a unit drift of the frequency, (3P,)."""
        one = np.ones(self.own.q.size)
        return np.concatenate([one, np.hypot(2 * _LOSSES * self.own.q, _DAMPING), one])

    def _varying(self, rest: Complexes, functions: Callable[[Reals], Reals]) -> Complexes:
        """Return d ln Z by a shift that varies over frequency, shape (N, M), beside the shifts of the resonances.

        It shifts the remainder, and the skirts of each resonance relative to its middle: what is called one resonance
        may be several, and those drift each by itself.
        """
        varying = functions(self.pair.log_f)
        made = rest[:, None] * varying
        own = self.own
        if own.poles.size:
            each = self._each[:, : own.poles.size]
            inside = np.clip(np.log(np.abs(own.poles)), self.pair.log_f[0], self.pair.log_f[-1])
            middle = functions(inside)
            made = made + np.sum(each, axis=1)[:, None] * varying - each @ middle
        return np.asarray(made, np.complex128)

    def _of_each(self) -> Complexes:
        """Return d ln Z of the device / d ln frequency, ln Q and ln strength of each resonance, shape (N, 3P)."""
        own, f = self.own, self.pair.frequency
        made: list[Complexes] = []
        for step in _STEP * np.eye(3):
            now = pole_terms(f, *changed(own.poles, own.residues, *step))
            made.append(np.asarray((own.seen(f) - now) / self._Y[:, None] / _STEP, np.complex128))
        return np.hstack(made)

    def unsettled(self, uncertain: float) -> "Drift":
        """Return the same with resonances that may still move by this many half widths."""
        made = copy(self)
        made.point = replace(self.point, uncertain=uncertain)
        vars(made).pop("_of_uncertain", None)
        return made

    def nudged(self) -> Iterator[tuple[Impedances, Resonances, float]]:
        """Yield the device with a step in ln frequency, then in ln Q, then in ln strength, of each resonance."""
        f, own = self.pair.frequency, self.own
        seen = own.seen(f)
        for step in _STEP * np.eye(3):
            poles, residues = changed(own.poles, own.residues, *step)
            now = pole_terms(f, poles, residues)
            for k in range(poles.size):
                moved = own.with_others([k], poles[k : k + 1], residues[k : k + 1])
                yield 1 / (self._Y + now[:, k] - seen[:, k]), moved, _STEP

    def _through(self, through: Complexes) -> Complexes:
        """Return d ln Z after / d ln Z of the device, shape (N, 1)."""
        return np.ones_like(through)[:, None] if self.point.after else through[:, None]

    def columns(self, through: Complexes, each: Complexes | None) -> dict[str, Complexes]:
        """Return the changes of ln Z after by a unit drift of all resonances together, and of each, shapes (N, M).

        `through`: d ln Z after / d ln Z before; `each`: derivatives by each resonance, if they are known.
        """
        s = self._through(through)
        each = (s * self._each if each is None else each) * self._unit
        together, remainder = self._rest
        common = np.sum(each.reshape(each.shape[0], 3, -1), axis=2) * _TOGETHER
        common[:, 0] += (s * together)[:, 0]
        return {
            "drift": np.asarray(common[:, :2], np.complex128),
            "strength": np.asarray(common[:, 2:], np.complex128),
            "wander": np.asarray(np.hstack([s * remainder, each]), np.complex128),
        }

    def so_far(self, through: Complexes, each: Complexes | None) -> Complexes:
        """Return the part of ln Z after that the columns attribute to the drift that is applied already, shape (N,)."""
        each = self._through(through) * self._each if each is None else each
        return np.asarray(each @ self.point.moved, np.complex128)

    def moved_by(self, coefficients: Reals) -> Reals:
        """Return the drift of each resonance by coefficients of all columns, as in a `DriftPoint`, shape (3P,)."""
        count = self.own.poles.size
        return (
            coefficients[coefficients.size - 3 * count :] + np.repeat(_TOGETHER * coefficients[:3], count)
        ) * self._unit

    def towards(self, moved: Reals) -> DriftPoint:
        """Return the point to linearise at next."""
        most = _FURTHEST * self._unit
        stride = np.concatenate([_STRIDE / (2 * self.own.q), np.full(2 * self.own.poles.size, _STRIDE)])
        step = np.clip(moved - self.point.moved, -stride, stride)
        return replace(self.point, moved=np.clip(self.point.moved + step, -most, most))

    def settled(self, moved: Reals) -> bool:
        """Return whether drift is where it was linearised, to a small part of each resonance's width."""
        count = self.own.poles.size
        step = np.abs(moved - self.point.moved)
        return bool(np.all(step[:count] * 2 * self.own.q < _SETTLED) and np.all(step[count:] < _SETTLED))

    def second_order(self, through: Complexes, drift: float) -> Reals:
        """Return the standard deviation of ln Z after by the second order of a drift of the remainder, shape (N,)."""
        remainder = np.hypot(0.5 * drift**2 * np.abs(self._bend), drift * self._slope_error)
        return np.abs(self._through(through)[:, 0]) * remainder

    def uncertain(self, through: Complexes) -> Reals:
        """Return the standard deviation of ln Z after by the second order of an unsettled drift, shape (N,)."""
        return np.abs(self._through(through)[:, 0]) * self._of_uncertain

    @cached_property
    def _of_uncertain(self) -> Reals:
        own, f = self.own, self.pair.frequency
        if not self.point.uncertain or not own.poles.size:
            return np.zeros(f.size)
        part = self.point.uncertain / (2 * own.q)
        up, down = (pole_terms(f, *changed(own.poles, own.residues, a, 0.0, 0.0)) for a in (part, -part))
        curved = np.abs(up + down - 2 * own.seen(f)) / np.abs(self._Y)[:, None]
        sloped = np.abs(up - down) / 2 / np.abs(self._Y)[:, None]
        return np.asarray(np.linalg.norm(np.hypot(curved, sloped**2), axis=1) / 2, np.float64)
