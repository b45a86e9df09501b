"""A piezoelectric layer that the power of the sweep warms: its constants at each point depend on what came before."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances, Reals
from .assembly import Assembly, Record
from .drifting import at_each_point
from .last_made import LastMade

_ROUNDS = 25
_SETTLED = 1e-12
"""Relative change of a constant between two rounds that counts as none."""
_SLIGHTLY = 1e-7
"""Relative change of the constants by which the derivative by the heat is computed."""
_MOST = 0.3
"""Largest relative change of a constant; the model is not valid beyond."""
_LEAST_STABLE = 0.1
"""Least value of 1 - d heat / d heat: where it is zero, the device jumps from cold to warm."""


@dataclass(frozen=True, eq=False)
class _Memory:
    """A thermal time constant: time dT/dt = P - T from T = 0, exact for a power that is linear between two points."""

    order: slice
    """From points in order of frequency to their order in time, and back."""
    kept: Reals
    """Part of T that is left at the next point, shape (N - 1,)."""
    before: Reals
    """Weight of the power at the point before, shape (N - 1,)."""
    now: Reals
    """Weight of the power at the point itself, shape (N - 1,)."""

    @classmethod
    def of(cls, elapsed: Reals, time: float) -> "_Memory":
        """Return the memory of a sweep that passes its points at these times, both in the same unit."""
        order = slice(None, None, 1 if elapsed[-1] >= elapsed[0] else -1)
        steps = np.maximum(np.diff(elapsed[order]) / time, 1e-12)
        mean = -np.expm1(-steps) / steps
        return cls(order, np.exp(-steps), mean - np.exp(-steps), 1 - mean)

    def missing(self, power: Reals, heat: Reals) -> Reals:
        """Return by how much the power warms each point more than the heat says, in order of time, shape (..., N)."""
        P, T = power[..., self.order], heat[..., self.order]
        made = np.zeros_like(P)
        made[..., 0] = -T[..., 0]
        made[..., 1:] = self.before * P[..., :-1] + self.now * P[..., 1:] + self.kept * T[..., :-1] - T[..., 1:]
        return made

    def follows(self, missing: Reals, by_heat: Reals) -> Reals:
        """Return the change of heat for what is missing (in order of time), shape (..., N), in order of frequency.

        `by_heat`: d power / d heat at each point, shape (N,). Every point depends on itself and on the one before.
        """
        from scipy.linalg import solve_banded  # imported late: a list of the effects need not wait for it

        slope = by_heat[self.order]
        bands = np.zeros((2, slope.size))
        bands[0] = 1.0
        bands[0, 1:] = np.maximum(1 - self.now * slope[1:], _LEAST_STABLE)
        bands[1, :-1] = -(self.kept + self.before * slope[:-1])
        return np.asarray(solve_banded((1, 0), bands, missing.T).T, np.float64)[..., self.order]


@dataclass(frozen=True, eq=False)
class _Warm:
    """A device with this heat at each point, and the power that it takes up then."""

    device: Assembly
    heat: Reals
    """The power that would keep it as warm, W, shape (N,)."""
    Z: Impedances
    """ohm, shape (N,)."""
    power: Reals
    """W, shape (N,)."""
    per_log: Complexes
    """d power = Re(per_log d ln Z), W, shape (N,)."""


@dataclass(frozen=True, eq=False)
class _Course:
    """The course of heat that agrees with the power that it lets the device take up."""

    warm: _Warm
    by_heat: Complexes
    """d ln Z / d heat, 1/W, shape (N,)."""
    memory: _Memory

    def follows(self, missing: Reals) -> Complexes:
        """Return the change of ln Z by that of the heat, if this is missing at a fixed one; shapes (..., N)."""
        return self.by_heat * self.memory.follows(missing, np.real(self.warm.per_log * self.by_heat))


@dataclass(frozen=True, eq=False)
class Heating(Record):
    """The layer is as warm at each point as the power until then has made it, beginning cold.

    Stiffness and permittivity change in proportion to the heat, the power that would keep the device as warm.
    """

    layer: str
    stiffness: float
    """Relative change per watt that lasts, 1/W."""
    permittivity: float
    """The same of the permittivity, 1/W."""
    time: float
    """Thermal time constant, in durations of the step's first sweep."""
    source: float
    """Resistance, ohm."""
    _courses: LastMade[_Course] = field(default_factory=LastMade[_Course], init=False, repr=False)

    def computed(self, device: Assembly, frequency: Frequencies) -> Complexes:
        """Return the recorded impedance over the steady one, shape (N,)."""
        return self._course(device, frequency).warm.Z / device.steady(frequency)

    def slopes(self, device: Assembly, frequency: Frequencies, names: Sequence[str], at_rest: Complexes) -> Complexes:
        """Return d ln factor / d parameter, shape (P, N): at a fixed heat, and by what it changes."""
        course = self._course(device, frequency)
        _, fixed = course.warm.device.steady_jacobian(frequency, names)
        power = np.real(course.warm.per_log * fixed)
        return fixed + course.follows(course.memory.missing(power, np.zeros_like(power))) - at_rest

    def change(self, device: Assembly, other: Record, moved: Assembly, frequency: Frequencies) -> Complexes:
        """Return the change of ln factor, shape (N,): at a fixed heat, and by what it changes."""
        if not isinstance(other, Heating):
            return super().change(device, other, moved, frequency)
        course = self._course(device, frequency)
        there = other.warmed(moved, frequency, course.warm.heat)
        fixed = there.Z / course.warm.Z - moved.steady(frequency) / device.steady(frequency)
        return fixed + course.follows(other.memory(moved, frequency).missing(there.power, there.heat))

    def warmed(self, device: Assembly, frequency: Frequencies, heat: Reals) -> _Warm:
        """Return the device with this heat at each point, W, shape (N,)."""
        laws = {"c_law": self.stiffness, "eps_law": self.permittivity}
        factors = {law: 1 + np.clip(size * heat, -_MOST, _MOST).astype(np.complex128) for law, size in laws.items()}
        warm = at_each_point(device, self.layer, factors)
        Z = warm.steady(frequency)
        current = device.conditions.level_V / np.abs(Z + self.source)
        power = current**2 * Z.real
        return _Warm(warm, heat, Z, power, current**2 * Z - 2 * power * Z / (Z + self.source))

    def memory(self, device: Assembly, frequency: Frequencies) -> _Memory:
        """Return the memory of the sweep that records this device."""
        return _Memory.of(device.conditions.elapsed(frequency.size), self.time)

    def _course(self, device: Assembly, frequency: Frequencies) -> _Course:
        return self._courses.of(device, frequency, lambda: self._agreeing(device, frequency))

    def _agreeing(self, device: Assembly, frequency: Frequencies) -> _Course:
        memory, size = self.memory(device, frequency), max(abs(self.stiffness), abs(self.permittivity))
        heat = np.zeros(frequency.size)
        for _ in range(_ROUNDS):
            course = self._with_slope(device, frequency, heat, memory)
            missing = memory.missing(course.warm.power, heat)
            step = memory.follows(missing, np.real(course.warm.per_log * course.by_heat))
            if size * np.max(np.abs(step)) < _SETTLED:
                return course
            heat = heat + step
        return self._with_slope(device, frequency, heat, memory)

    def _with_slope(self, device: Assembly, frequency: Frequencies, heat: Reals, memory: _Memory) -> _Course:
        """Return the device with this heat, and what a little more of it would change."""
        more = _SLIGHTLY / max(abs(self.stiffness), abs(self.permittivity))
        warm, near = (self.warmed(device, frequency, one) for one in (heat, heat + more))
        return _Course(warm, (near.Z / warm.Z - 1) / more, memory)
