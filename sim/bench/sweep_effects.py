"""Effects during a sweep: the device drifts, softens with the level and responds late.

They are computed point by point in the order of the sweep, on the parameters of the model.
"""

from collections.abc import Mapping
from dataclasses import dataclass, fields, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...models.base.arrays import Frequencies, Impedances, Reals
from ...models.base.model import Model
from ..instrument.axis import Axis
from .bench_errors import BenchError
from .json_numbers import finite, quoted

SOURCE_OHM = 25.0
"""Source resistance of the analyzer, which reduces the level at the device."""

STIFFNESS_PER_KELVIN, PERMITTIVITY_PER_KELVIN = -1.4e-4, 4e-3
"""Relative change of c33D and eps33S of a soft PZT per kelvin (frequency falls by 0.7e-4/K)."""

RAYLEIGH = 4 / (3 * np.pi)
"""Loss per softening of a Rayleigh loop: Hall, J. Mater. Sci. 36 (2001) 4575."""


@dataclass(frozen=True)
class Effects:
    """Hidden effects of the device; 0 switches one off."""

    drift_K_per_s: float = 0.0
    """The device warms at this rate in bench time."""
    start_K: float = 0.0
    """Temperature above the reference at bench time 0, K."""
    lag_s: float = 0.0
    """The reading lags by this many seconds: Y(f - rate * lag)."""
    strain_softening: float = 0.0
    """a in c33D (1 - a |S|), |S| the mean strain's amplitude; the loss grows by 4/(3 pi) a |S| (Rayleigh's law)."""

    def changed(self, values: Mapping[str, Any]) -> "Effects":
        """Return the effects with some changed. Raises BenchError for an unknown name or a non-numeric value."""
        names = [f.name for f in fields(self)]
        for name, value in values.items():
            if name not in names:
                raise BenchError(f"bench: no effect {name!r}; there are {', '.join(names)}")
            if finite(value) is None:
                raise BenchError(f"bench: {name} is {quoted(value)}; a number is needed")
        return replace(self, **values)


def device_impedance(
    device: Model, effects: Effects, axis: Axis, when: Reals, point_seconds: Reals, order: NDArray[np.intp]
) -> Impedances:
    """Return Z of the device, shape (N,); point k is measured at `when[k]` s, the points are swept in `order`."""
    frequency = lagging(axis.frequency, point_seconds, order, effects.lag_s)
    temperature = effects.start_K + effects.drift_K_per_s * when
    if not effects.strain_softening and not np.any(temperature):
        return device.impedance(frequency)
    z = np.empty(frequency.size, dtype=np.complex128)
    strain = 0.0
    for k in order:
        here = warmed(device, float(temperature[k]))
        z[k], strain = _softened(here, frequency[k : k + 1], float(axis.level[k]), effects.strain_softening, strain)
    return z


def lagging(frequency: Frequencies, point_seconds: Reals, order: NDArray[np.intp], lag_s: float) -> Frequencies:
    """Return the frequency whose response is read at each point: it lags by the sweep rate times the lag."""
    if not lag_s or np.ptp(frequency) == 0:
        return frequency
    rate = np.empty_like(frequency)
    rate[order] = np.gradient(frequency[order]) / point_seconds[order]
    return np.maximum(frequency - rate * lag_s, frequency.min() / 2)


def warmed(device: Model, kelvin: float) -> Model:
    """Return the device with its piezoelectric layers this many kelvins above the reference temperature."""
    if kelvin == 0:
        return device
    have = device.parameters()
    factors = {"c33D": 1 + STIFFNESS_PER_KELVIN * kelvin, "eps33S": 1 + PERMITTIVITY_PER_KELVIN * kelvin}
    parts = (f"{name}.{part}" for name in piezos(have) for part in ("c33D.re", "c33D.im", "eps33S.re", "eps33S.im"))
    return device.replace({part: have[part] * factors[part.split(".")[1]] for part in parts})


def piezos(parameters: Mapping[str, float]) -> list[str]:
    """Return the piezoelectric layers of a model with these parameters."""
    return [name.removesuffix(".h33.re") for name in parameters if name.endswith(".h33.re")]


def _complex(parameters: Mapping[str, float], constant: str) -> complex:
    (disk,) = piezos(parameters)
    return complex(parameters[f"{disk}.{constant}.re"], parameters[f"{disk}.{constant}.im"])


def _softened(
    device: Model, frequency: Frequencies, level: float, softening: float, strain: float
) -> tuple[complex, float]:
    """Return Z at one frequency and the strain there, by iteration from the strain of the point before.

    This start makes the jump depend on the direction of the sweep.
    """
    z = complex(device.impedance(frequency)[0])
    if not softening:
        return z, 0.0
    have = device.parameters()
    c33D, (disk,) = _complex(have, "c33D"), piezos(have)
    for _ in range(40):
        softer = c33D * (1 - softening * strain * (1 - 1j * RAYLEIGH))
        bent = device.replace({f"{disk}.c33D.re": softer.real, f"{disk}.c33D.im": softer.imag})
        z = complex(bent.impedance(frequency)[0])
        now = mean_strain(have, z, float(frequency[0]), level)
        if abs(now - strain) <= 1e-4 * max(now, 1e-12):
            break
        strain = (strain + now) / 2
    return z, strain


def mean_strain(parameters: Mapping[str, float], z: complex, frequency: float, level: float) -> float:
    """Return the amplitude of the disk's mean strain under `level` volts rms behind the source resistance.

    V = I/(j w C0) - h t S for the mean strain S, so |S| = |I| |Z - 1/(j w C0)| / (|h| t).
    """
    (disk,) = piezos(parameters)
    thickness = parameters[f"{disk}.thickness"]
    clamped = thickness / (2j * np.pi * frequency * _complex(parameters, "eps33S") * parameters["area"])
    current = np.sqrt(2) * level / abs(z + SOURCE_OHM)
    return float(current * abs(z - clamped) / (abs(_complex(parameters, "h33")) * thickness))
