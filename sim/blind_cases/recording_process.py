"""How a recording comes about: point after point in time, with a detector that settles, on a specimen that changes."""

from dataclasses import dataclass

import numpy as np
from scipy.signal import lfilter

from .device_under_test import DeviceUnderTest
from .node_circuit import measured_impedance
from .parallel_columns import STILL, Moment, device_admittance, mean_strain
from .scenario import Hidden
from .waves import Complexes, Reals

_BETWEEN = 16
"""Steps of time from one point to the next where the detector lags."""
_ROUNDS = 25


@dataclass(frozen=True, eq=False)
class SweepSpec:
    """One sweep: which step, where, how."""

    step: str
    frequency: Reals
    """Hz, rising, shape (N,)."""
    down: bool = False
    seconds: float = 0.0
    level_V: float = 0.5
    order: int = 0
    """How many sweeps of this step came before it."""
    noise: float = 2e-4
    """Relative, of real and imaginary part each."""
    bandwidth: int = 5


def record(specimen: DeviceUnderTest, hidden: Hidden, take: SweepSpec) -> Complexes:
    """Return what the analyzer would show without noise; ohm, shape (N,), in the order of rising frequency."""
    f = take.frequency
    if hidden.settling > 0:
        z = _lagging(specimen, hidden, take)
    elif hidden.softening > 0:
        z = _driven(specimen, hidden, take)
    else:
        z = _steady(f, specimen, hidden, take.step, _moment(hidden, take, f))
    z = {"as it is": z, "conjugated": np.conj(z), "inverted": -z}[hidden.recorded]
    return z if hidden.outside is None else _flawed(z, take, *hidden.outside)


def noisy(z: Complexes, take: SweepSpec, rng: np.random.Generator) -> Complexes:
    """Return a recording with the analyzer's noise: relative to |Z|, and some microohms where it is small."""
    size = take.noise * np.abs(z) + 5e-6
    return z + size * (rng.standard_normal(z.size) + 1j * rng.standard_normal(z.size))


def _steady(f: Reals, specimen: DeviceUnderTest, hidden: Hidden, step: str, moment: Moment) -> Complexes:
    return measured_impedance(2 * np.pi * f, device_admittance(f, specimen, hidden, step, moment), hidden.path)


def _progress(take: SweepSpec, f: Reals) -> Reals:
    """Return when each point is taken, in sweeps since the first one of its step began; shape (N,)."""
    part = (f - take.frequency[0]) / (take.frequency[-1] - take.frequency[0])
    return take.order + ((1 - part) if take.down else part)


def _moment(hidden: Hidden, take: SweepSpec, f: Reals) -> Moment:
    if hidden.drift is None:
        return STILL
    t = _progress(take, f)
    return Moment(
        np.asarray(1 + hidden.drift[0] * t, np.complex128), np.asarray(1 + hidden.drift[1] * t, np.complex128)
    )


def _lagging(specimen: DeviceUnderTest, hidden: Hidden, take: SweepSpec) -> Complexes:
    """Let the detector's output run after the admittance, exponentially, while the frequency moves on."""
    f = take.frequency
    n = f.size
    fine = np.interp(np.arange((n - 1) * _BETWEEN + 1) / _BETWEEN, np.arange(n), f)
    y = 1 / _steady(fine, specimen, hidden, take.step, _moment(hidden, take, fine))
    y = y[::-1] if take.down else y
    dt = take.seconds / (fine.size - 1)
    keep = np.exp(-dt / hidden.settling)
    # between two instants the admittance is a straight line: the filter's exact answer to a ramp
    ramp = hidden.settling / dt * (1 - keep)
    out = np.asarray(lfilter([1 - ramp, ramp - keep], [1, -keep], y, zi=[y[0] * ramp])[0], np.complex128)
    shown = 1 / out[::_BETWEEN]
    return shown[::-1] if take.down else shown


def _driven(specimen: DeviceUnderTest, hidden: Hidden, take: SweepSpec) -> Complexes:
    """Find, at each point, the strain of a disk that the strain softens; the analyzer holds its voltage.

    Strain and stiffness follow one another until they agree.
    """
    f = take.frequency
    soft = np.zeros_like(f)
    z = _steady(f, specimen, hidden, take.step, STILL)
    for _ in range(_ROUNDS):
        moment = Moment(1 - soft + 0.5j * soft)
        z = _steady(f, specimen, hidden, take.step, moment)
        strain = np.abs(mean_strain(f, specimen, hidden, take.step, moment)) * take.level_V / np.abs(z)
        soft = 0.5 * soft + 0.5 * np.minimum(hidden.softening * strain, 0.2)
    return z


def _flawed(z: Complexes, take: SweepSpec, kind: str, size: float, where: float) -> Complexes:
    """Return the recording with a flaw of the instrument."""
    f = take.frequency
    x = (f - f[0]) / (f[-1] - f[0])
    if kind == "range step":
        return z * np.where(x > where, 1 + size, 1.0)
    if kind == "gain ripple":
        return z * (1 + size * np.sin(2 * np.pi * (2 + 6 * where) * x + 9 * where))
    if kind == "phase error":  # grows with the square of frequency
        return z * np.exp(1j * size * (f / f[-1]) ** 2)
    k = np.arange(f.size)
    if kind == "glitch":
        at = int(where * (f.size - 12))
        return z * np.where((k >= at) & (k < at + 6), 1 + size * (1 + 1j), 1.0)
    if kind == "range to and fro":
        return z * np.where((k // int(25 + 100 * where)) % 2 == 1, 1 + size * (1 - 0.6j), 1.0)
    if kind == "loose contact":  # some ohms more, for three stretches of the sweep
        ohms = size * float(np.median(np.abs(z)))
        return z + ohms * ((x > where) & (x < where + 0.02) | (x > 0.3 * where) & (x < 0.4 * where) | (x > 0.93))
    if kind == "mains hum":  # the beat of a mains harmonic with the detector's pace
        return z * (1 + size * np.sin(2 * np.pi * k / (7 + 20 * where)))
    if kind == "mixing":  # a harmonic of the drive falls on a resonance: a dip in size without the phase that belongs
        return z * (1 - size / (1 + ((x - where) / 0.01) ** 2))
    if kind == "flicker conductance":  # falls as 1/f, with nothing stored
        return z / (1 + z * size * (f[0] / f) / np.abs(z[0]))
    return z
