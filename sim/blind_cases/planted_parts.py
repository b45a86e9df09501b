"""Known effects added to recordings of real devices, whose own properties are not known.

Terminal effects are exact two-ports. A drift moves all resonances of the device in time; a lag is the output of a
filter that follows the swept admittance. Both use a spline through the recording.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from scipy.interpolate import CubicSpline

from .waves import Complexes, Reals

_CABLE = 50.0
"""ohm, characteristic impedance of a planted cable."""
_LEFT_BY_FIXTURE = {"inductance": 1e-9, "resistance": 1e-2, "capacitance": 2e-14, "conductance": 3e-9}
"""What open and short compensation of a fixture usually leaves: H, ohm, F, S."""
_MORE = 5.0
"""How many times as large a planted part is at least: a smaller one is what any fixture may leave."""
_FINE = 8
_BISECTIONS = 60

Apply = Callable[[Reals, Complexes, float, bool], Complexes]
"""Frequencies in Hz (N,), impedance in ohm (N,), size, whether the sweep runs downwards: recorded impedance, ohm."""


@dataclass(frozen=True)
class Part:
    """One kind of planted effect: its name and size parameter in the catalogue, and its function."""

    effect: str
    where: str
    size: str
    """Name of the finding's parameter for the size, SI."""
    apply: Apply
    in_time: bool = False
    """Whether it needs a pair of sweeps, up and down."""
    others: dict[str, str] = field(default_factory=dict[str, str])
    """Effects that are equivalent where `alike` says so, with their parameter for the same size."""


def _lead(f: Reals, z: Complexes, size: float, _: bool) -> Complexes:
    return z + 2j * np.pi * f * size


def _resistance(_: Reals, z: Complexes, size: float, __: bool) -> Complexes:
    return z + size


def _stray(f: Reals, z: Complexes, size: float, _: bool) -> Complexes:
    return 1 / (1 / z + 2j * np.pi * f * size)


def _leakage(_: Reals, z: Complexes, size: float, __: bool) -> Complexes:
    return 1 / (1 / z + size)


def _cable(f: Reals, z: Complexes, size: float, _: bool) -> Complexes:
    """Put a lossless line of this inductance (H) in front of the device."""
    turn = np.tan(2 * np.pi * f * size / _CABLE)
    return _CABLE * (z + 1j * _CABLE * turn) / (_CABLE + 1j * z * turn)


def _drift(f: Reals, z: Complexes, size: float, down: bool) -> Complexes:
    """Let all resonances rise by `size` in a sweep, linearly; a downward sweep comes after the upward one."""
    t = np.linspace(0, 1, f.size)
    factor = 1 + size * ((2 - t) if down else t)
    return np.asarray(_spline(f, z)(f / factor) / factor, np.complex128)


def _lag(f: Reals, z: Complexes, size: float, down: bool) -> Complexes:
    """Let a filter of one pole follow the admittance; it settles while the sweep goes on by `size` Hz."""
    from scipy.signal import lfilter  # imported late: it takes half a second, and few recordings need it

    fine = np.interp(np.arange((f.size - 1) * _FINE + 1) / _FINE, np.arange(f.size), f)
    y = 1 / np.asarray(_spline(f, z)(fine), np.complex128)
    y = y[::-1] if down else y
    points = size / (float(f[-1] - f[0]) / (fine.size - 1))
    keep = np.exp(-1 / points)
    ramp = points * (1 - keep)
    late = np.asarray(lfilter([1 - ramp, ramp - keep], [1, -keep], y, zi=[y[0] * ramp])[0], np.complex128)
    shown = 1 / late[::_FINE]
    return shown[::-1] if down else shown


def _spline(f: Reals, z: Complexes) -> CubicSpline:
    """Return the recording as a curve, constant beyond its ends."""
    pad = 0.02 * (f[-1] - f[0])
    return CubicSpline(np.r_[f[0] - pad, f, f[-1] + pad], np.r_[z[0], z, z[-1]])


PARTS: tuple[Part, ...] = (
    Part("lead-inductance", "terminals", "inductance", _lead),
    Part("series-resistance", "terminals", "resistance", _resistance),
    Part("stray-capacitance", "terminals", "capacitance", _stray),
    Part("leakage", "terminals", "conductance", _leakage),
    Part("cable", "terminals", "inductance", _cable, others={"lead-inductance": "inductance"}),
    Part("temperature-drift", "sweep", "relative", _drift, in_time=True),
    Part("sweep-lag", "sweep", "lag", _lag, in_time=True),
)
"""All effects that are planted in each recording."""


def moves(before: Complexes, after: Complexes) -> float:
    """Return the root mean square of |difference of ln Z|."""
    d = np.log(after / before)
    return float(np.sqrt(np.mean(np.abs(d) ** 2)))


def sized(part: Part, f: Reals, z: Complexes, wanted: float) -> float | None:
    """Return the size for which a part changes ln Z by the given root mean square, found by bisection, or a larger one.

    Larger where a fixture may leave as much. None where no realistic size does: resonances drift by at most 0.3 % in a
    sweep, a filter lags by at most 0.2 % of the frequency.
    """
    typical = float(np.median(np.abs(z)))
    top = {
        "inductance": typical / (2 * np.pi * float(f[-1])),
        "resistance": typical,
        "capacitance": 1 / (2 * np.pi * float(f[-1]) * typical),
        "conductance": 1 / typical,
        "relative": 3e-3,
        "lag": 2e-3 * float(f[-1]),
    }[part.size]
    low, high = 1e-6 * top, top
    if moves(z, part.apply(f, z, top, False)) < wanted:
        return None
    for _ in range(_BISECTIONS):
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if moves(z, part.apply(f, z, middle, False)) < wanted else (low, middle)
    return max(float(np.sqrt(low * high)), _MORE * _LEFT_BY_FIXTURE.get(part.size, 0.0))


def alike(part: Part, f: Reals, z: Complexes, size: float) -> tuple[str, ...]:
    """Return the effects that cannot be distinguished from the part: they differ by a tenth of its change of ln Z."""
    with_part = part.apply(f, z, size, False)
    by_name = {one.effect: one for one in PARTS}
    return tuple(
        name
        for name in part.others
        if moves(with_part, by_name[name].apply(f, z, size, False)) < 0.1 * moves(z, with_part)
    )


def own_noise(z: Complexes) -> float:
    """Return the relative noise of a recording per real and imaginary part, from third differences of ln Z."""
    third = np.diff(np.log(np.abs(z)), 3)
    return float(np.median(np.abs(third)) / 0.6745 / np.sqrt(20.0))
