"""Makes the recordings of the lab world: a sweep in time, a detector with two poles, an analyzer with errors."""

from dataclasses import dataclass, field

import numpy as np

from ..waves import Complexes, Reals
from .devices.device import STILL, Instant, admittance, strain
from .devices.flaws import FixtureResidue, Flaws
from .devices.specimen import LabDevice
from .devices.terminals import at_analyzer

_BETWEEN = 8
"""Time steps from one point to the next for a detector that lags."""
_ROUNDS = 12
_STRAIN = 1e-5
"""Reference strain of softening."""


@dataclass(frozen=True, eq=False)
class LabSweep:
    """One sweep: the step, the frequencies and the settings."""

    step: str
    frequency: Reals
    """Hz, rising, shape (N,)."""
    down: bool = False
    seconds: float = 0.0
    level_V: float = 0.5
    order: int = 0
    """Number of earlier sweeps of this step."""


@dataclass(frozen=True, eq=False)
class ErringAnalyzer:
    """The instrument's own error, the same in all sweeps of a session; smooth over ln f by cosines.

    Gain and phase are sums over n of coefficients times cos(n pi u), u = 0 to 1 over the session's widest band in ln f.
    """

    band: tuple[float, float]
    """Hz."""
    gain: tuple[float, ...] = ()
    phase: tuple[float, ...] = ()
    """rad."""
    steps: tuple[tuple[float, float], ...] = ()
    """Range switches: |Z| in ohm, and the increase in gain above it."""
    noise: float = 2e-4
    """Relative standard deviation of real and imaginary part."""
    colour: float = 0.0
    """Coefficient of the noise's AR(1) process; it does not change the variance."""
    fixture: FixtureResidue = field(default_factory=FixtureResidue)
    bandwidth: int = 5

    def error(self, f: Reals, z: Complexes) -> Complexes:
        """Return the factor of the displayed over the true impedance; shape (N,)."""
        u = np.log(f / self.band[0]) / np.log(self.band[1] / self.band[0])
        gain = sum((a * np.cos(n * np.pi * u) for n, a in enumerate(self.gain)), np.zeros_like(f))
        phase = sum((a * np.cos(n * np.pi * u) for n, a in enumerate(self.phase)), np.zeros_like(f))
        for ohm, step in self.steps:
            gain = gain + step * (np.abs(z) > ohm)
        return np.exp(gain + 1j * phase)

    def noisy(self, z: Complexes, rng: np.random.Generator) -> Complexes:
        """Return a recording with noise, in the order of its points."""
        white = rng.standard_normal((2, z.size))
        if self.colour:
            a = self.colour
            from scipy.signal import lfilter

            white = lfilter([np.sqrt(1 - a**2)], [1, -a], white, axis=1, zi=a * rng.standard_normal((2, 1)))[0]
        return z + (self.noise * np.abs(z) + 5e-6) * (white[0] + 1j * white[1])


def shown(specimen: LabDevice, flaws: Flaws, sweep: LabSweep, fixture: FixtureResidue) -> Complexes:
    """Return the reading of an ideal analyzer without noise; ohm, shape (N,), by rising frequency."""
    if flaws.settling > 0:
        z = _lagging(specimen, flaws, sweep, fixture)
    elif flaws.softening is not None:
        z = _driven(specimen, flaws, flaws.softening, sweep, fixture)
    else:
        z = _steady(sweep.frequency, specimen, flaws, sweep.step, _moment(flaws, sweep, sweep.frequency), fixture)
    z = {"as it is": z, "conjugated": np.conj(z), "inverted": -z}[flaws.recorded]
    return z if flaws.recording is None else _faulty(z, sweep, *flaws.recording)


def _steady(
    f: Reals, specimen: LabDevice, flaws: Flaws, step: str, moment: Instant, fixture: FixtureResidue
) -> Complexes:
    Y = admittance(f, specimen, flaws, step, moment)
    return at_analyzer(f, Y, flaws.wiring, fixture, specimen.ceramic.f0)


def _moment(flaws: Flaws, sweep: LabSweep, f: Reals) -> Instant:
    """Return the device's drift at each point; points are evenly spaced in time."""
    if flaws.drift is None:
        return STILL
    part = np.interp(f, sweep.frequency, np.linspace(0, 1, sweep.frequency.size))
    t = sweep.order + ((1 - part) if sweep.down else part)
    c, eps, time = flaws.drift
    # the electrodes' heat goes first, then that of the jig
    grown = 1 - 0.7 * np.exp(-t / time) - 0.3 * np.exp(-t / (5 * time))
    return Instant(np.asarray(1 + c * grown, np.complex128), np.asarray(1 + eps * grown, np.complex128))


def _lagging(specimen: LabDevice, flaws: Flaws, sweep: LabSweep, fixture: FixtureResidue) -> Complexes:
    """Filter the swept admittance with two equal poles."""
    from scipy.signal import lfilter  # imported late: it takes half a second, and few recordings need it

    f = sweep.frequency
    fine = np.interp(np.arange((f.size - 1) * _BETWEEN + 1) / _BETWEEN, np.arange(f.size), f)
    y = 1 / _steady(fine, specimen, flaws, sweep.step, _moment(flaws, sweep, fine), fixture)
    y = y[::-1] if sweep.down else y
    dt = sweep.seconds / (fine.size - 1)
    keep = np.exp(-dt / flaws.settling)
    ramp = flaws.settling / dt * (1 - keep)
    for _ in range(2):
        y = lfilter([1 - ramp, ramp - keep], [1, -keep], y, zi=[y[0] * ramp])[0]
    z = np.asarray(1 / y[::_BETWEEN], np.complex128)
    return z[::-1] if sweep.down else z


def _driven(
    specimen: LabDevice, flaws: Flaws, law: tuple[float, float, float], sweep: LabSweep, fixture: FixtureResidue
) -> Complexes:
    """Iterate strain and stiffness until they agree, at a constant voltage of the analyzer."""
    size, lost, power = law
    f = sweep.frequency
    soft = np.zeros_like(f)
    z = _steady(f, specimen, flaws, sweep.step, STILL, fixture)
    for _ in range(_ROUNDS):
        moment = Instant(1 - soft * (1 - 1j * lost))
        z = _steady(f, specimen, flaws, sweep.step, moment, fixture)
        amplitude = np.abs(strain(f, specimen, flaws, sweep.step, moment)) * sweep.level_V / np.abs(z)
        soft = 0.5 * soft + 0.5 * np.minimum(size * (amplitude / _STRAIN) ** power, 0.2)
    return z


def _faulty(z: Complexes, sweep: LabSweep, kind: str, size: float, where: float) -> Complexes:
    f = sweep.frequency
    x = (f - f[0]) / (f[-1] - f[0])
    if kind == "interference":  # a transmitter nearby: in a narrow band a voltage is added whose phase rotates
        bell = np.exp(-0.5 * ((x - where) / 0.012) ** 2)
        return z * (1 + size * bell * np.exp(40j * (x - where)))
    if kind == "loose contact":  # some ohms more in some parts of the sweep
        ohms = size * float(np.median(np.abs(z)))
        return z + ohms * ((x > where) & (x < where + 0.02) | (x > 0.3 * where) & (x < 0.4 * where) | (x > 0.93))
    return z * (1 - size / (1 + ((x - where) / 0.01) ** 2))  # mixing: a dip in magnitude without its phase
