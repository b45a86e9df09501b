"""Makes a recording point by point in time, of a drifting device with a settling detector."""

from dataclasses import dataclass

import numpy as np

from .device_under_test import DeviceUnderTest
from .node_circuit import measured_impedance
from .parallel_columns import NO_DRIFT, DriftFactors, device_admittance, mean_strain
from .scenario import Hidden
from .waves import Complexes, Reals

_BETWEEN = 16
"""Time steps from one point to the next for a detector that lags."""
_ROUNDS = 25


@dataclass(frozen=True, eq=False)
class SweepSpec:
    """One sweep: the step, the frequencies and the settings."""

    step: str
    frequency: Reals
    """Hz, rising, shape (N,)."""
    down: bool = False
    seconds: float = 0.0
    level_V: float = 0.5
    order: int = 0
    """Number of earlier sweeps of this step."""
    noise: float = 2e-4
    """Relative, of real and imaginary part each."""
    bandwidth: int = 5


def record(device: DeviceUnderTest, hidden: Hidden, sweep: SweepSpec) -> Complexes:
    """Return the reading of the analyzer without noise; ohm, shape (N,), in the order of rising frequency."""
    f = sweep.frequency
    if hidden.settling > 0:
        z = _lagging(device, hidden, sweep)
    elif hidden.softening > 0:
        z = _driven(device, hidden, sweep)
    else:
        z = _steady(f, device, hidden, sweep.step, _drift(hidden, sweep, f))
    z = {"as it is": z, "conjugated": np.conj(z), "inverted": -z}[hidden.recorded]
    return z if hidden.outside is None else _with_artefact(z, sweep, *hidden.outside)


def noisy(z: Complexes, sweep: SweepSpec, rng: np.random.Generator) -> Complexes:
    """Return a recording with the noise of the analyzer: relative to |Z|, plus 5 microohms."""
    size = sweep.noise * np.abs(z) + 5e-6
    return z + size * (rng.standard_normal(z.size) + 1j * rng.standard_normal(z.size))


def _steady(f: Reals, device: DeviceUnderTest, hidden: Hidden, step: str, drift: DriftFactors) -> Complexes:
    return measured_impedance(2 * np.pi * f, device_admittance(f, device, hidden, step, drift), hidden.path)


def _progress(sweep: SweepSpec, f: Reals) -> Reals:
    """Return the time of each point, in sweeps since the first sweep of its step began; shape (N,)."""
    part = (f - sweep.frequency[0]) / (sweep.frequency[-1] - sweep.frequency[0])
    return sweep.order + ((1 - part) if sweep.down else part)


def _drift(hidden: Hidden, sweep: SweepSpec, f: Reals) -> DriftFactors:
    if hidden.drift is None:
        return NO_DRIFT
    t = _progress(sweep, f)
    return DriftFactors(
        np.asarray(1 + hidden.drift[0] * t, np.complex128), np.asarray(1 + hidden.drift[1] * t, np.complex128)
    )


def _lagging(device: DeviceUnderTest, hidden: Hidden, sweep: SweepSpec) -> Complexes:
    """Return the sweep of a detector whose output follows the admittance exponentially."""
    from scipy.signal import lfilter  # imported late: it takes half a second, and few recordings need it

    f = sweep.frequency
    n = f.size
    fine = np.interp(np.arange((n - 1) * _BETWEEN + 1) / _BETWEEN, np.arange(n), f)
    y = 1 / _steady(fine, device, hidden, sweep.step, _drift(hidden, sweep, fine))
    y = y[::-1] if sweep.down else y
    dt = sweep.seconds / (fine.size - 1)
    keep = np.exp(-dt / hidden.settling)
    # the exact response of the filter to an admittance that is linear between two time steps
    ramp = hidden.settling / dt * (1 - keep)
    out = np.asarray(lfilter([1 - ramp, ramp - keep], [1, -keep], y, zi=[y[0] * ramp])[0], np.complex128)
    shown = 1 / out[::_BETWEEN]
    return shown[::-1] if sweep.down else shown


def _driven(device: DeviceUnderTest, hidden: Hidden, sweep: SweepSpec) -> Complexes:
    """Return the sweep of a disk that softens with its strain, at a constant voltage of the analyzer.

    Strain and stiffness are iterated at each point until they agree.
    """
    f = sweep.frequency
    soft = np.zeros_like(f)
    z = _steady(f, device, hidden, sweep.step, NO_DRIFT)
    for _ in range(_ROUNDS):
        drift = DriftFactors(1 - soft + 0.5j * soft)
        z = _steady(f, device, hidden, sweep.step, drift)
        strain = np.abs(mean_strain(f, device, hidden, sweep.step, drift)) * sweep.level_V / np.abs(z)
        soft = 0.5 * soft + 0.5 * np.minimum(hidden.softening * strain, 0.2)
    return z


def _with_artefact(z: Complexes, sweep: SweepSpec, kind: str, size: float, where: float) -> Complexes:
    """Return the recording with an instrument artefact."""
    f = sweep.frequency
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
    if kind == "loose contact":  # some ohms more, in three parts of the sweep
        ohms = size * float(np.median(np.abs(z)))
        return z + ohms * ((x > where) & (x < where + 0.02) | (x > 0.3 * where) & (x < 0.4 * where) | (x > 0.93))
    if kind == "mains hum":  # the beat of a mains harmonic with the detector's pace
        return z * (1 + size * np.sin(2 * np.pi * k / (7 + 20 * where)))
    if kind == "mixing":  # a harmonic of the drive falls on a resonance: a dip of |Z| without its phase
        return z * (1 - size / (1 + ((x - where) / 0.01) ** 2))
    if kind == "flicker conductance":  # falls as 1/f, without stored energy
        return z / (1 + z * size * (f[0] / f) / np.abs(z[0]))
    return z
