"""Predictions of a fitted disk where it was not recorded: resonances, antiresonances, capacitance."""

from collections.abc import Mapping, Sequence

import numpy as np

from ....models.base.arrays import Frequencies, Reals, j_omega
from ....models.base.local_maxima import prominent_peaks
from ....models.disk2d.disk_model import Disk2D
from ...interface import Constant

_POINTS = 4000
_PROMINENT = 0.01
# Smallest prominence of a peak of ln Re Y or ln Re Z.
_STEP = 1e-5
_LOW = 1e3
# Hz; the usual frequency of capacitance meters.
_BELOW = 0.6
# Part of the first resonance below which the capacitance is given once more.


def predictions(
    model: Disk2D, names: Sequence[str], covariance: Reals, low: float, high: float
) -> Mapping[str, Constant]:
    """Return resonances `fs1`, `fs2`, ... and antiresonances `fp1`, ... in Hz between two frequencies, by full name.

    Resonances are maxima of Re Y, antiresonances those of Re Z, counted from `low` upwards; all visible modes of the
    disk are included: radial, edge, thickness. `capacitance` is that at 1 kHz in F, complex, and `capacitance_at_F_kHz`
    that at the highest half octave above 10 kHz that is still well below the first resonance. Standard uncertainties
    follow from `covariance`, shape (P, P), of the parameters `names`: near a zero or a pole f0 of Z, ln Z is +-ln(f -
    f0) plus a smooth part, so df0/dp = -(d ln Z/dp)/(d ln Z/df).
    """
    at: Frequencies = np.linspace(low, high, _POINTS)
    Z = model.impedance(at)
    places = {"fs": _peaks(at, (1 / Z).real), "fp": _peaks(at, Z.real)}
    below = _half_octave(_BELOW * float(places["fs"][0])) if places["fs"].size else _LOW
    f: Frequencies = np.sort(np.concatenate([[_LOW, below], *places.values()]))
    parameters = model.parameters()
    moving = [k for k, name in enumerate(names) if name in parameters and covariance[k, k] > 0]
    own, slopes = model.jacobian(f, [names[k] for k in moving])
    by_f = np.log(model.impedance(f * (1 + _STEP)) / model.impedance(f * (1 - _STEP))) / (2 * _STEP * f)
    inner = covariance[np.ix_(moving, moving)]
    shift = -(slopes / by_f).real
    spread = np.sqrt(np.maximum(np.einsum("kn,kl,ln->n", shift, inner, shift), 0.0))
    constants: dict[str, Constant] = {}
    for kind, frequencies in places.items():
        for order, (place, u) in enumerate(zip(frequencies, spread[np.searchsorted(f, frequencies)], strict=True), 1):
            constants[f"{model.name}.{kind}{order}"] = Constant(float(place), 0.0, float(u), 0.0, "Hz")
    for name, at_low in (("capacitance", 0), (f"capacitance_at_{below / 1e3:.1f}_kHz", int(np.searchsorted(f, below)))):
        C = complex(1 / (j_omega(f) * own)[at_low])
        parts = [(-slopes[:, at_low] * C).real, (-slopes[:, at_low] * C).imag]
        u = [float(np.sqrt(max(0.0, part @ inner @ part))) for part in parts]
        constants[f"{model.name}.{name}"] = Constant(C.real, C.imag, u[0], u[1], "F")
    return constants


def _half_octave(limit: float) -> float:
    """Return the highest of 10 kHz times powers of the square root of two that does not exceed `limit`, Hz."""
    return 1e4 * 2.0 ** (np.floor(2 * np.log2(limit / 1e4)) / 2)


def _peaks(frequency: Frequencies, values: Reals) -> Frequencies:
    """Return the frequencies of the maxima of positive values, interpolated by a parabola through the logarithms."""
    level = np.log(np.maximum(values, np.finfo(float).tiny))
    there, _ = prominent_peaks(level, _PROMINENT)
    left, top, right = level[there - 1], level[there], level[there + 1]
    return frequency[there] + (left - right) / (2 * (left - 2 * top + right)) * (frequency[1] - frequency[0])


def sentence(made: Mapping[str, Constant], layer: str, bands: Sequence[tuple[float, float]]) -> str:
    """Return a sentence with resonances and antiresonances outside the recorded `bands` (Hz), and the capacitances."""

    def listed(kind: str) -> str:
        every = (c for name, c in made.items() if name.startswith(f"{layer}.{kind}"))
        outside = (c for c in every if not any(low <= c.re <= high for low, high in bands))
        return " ".join(f"{c.re / 1e3:.1f}({max(1, round((c.u_re or 0.0) / 100))})" for c in outside)

    Cs = ", ".join(
        f"{c.re * 1e9:.4g}({(c.u_re or 0.0) * 1e9:.1g}) nF (1 - {-c.im / c.re:.2g}j) at "
        + (name.split("_at_")[1].replace("_", " ") if "_at_" in name else "1 kHz")
        for name, c in made.items()
        if name.startswith(f"{layer}.capacitance")
    )
    recorded = ", ".join(f"{low / 1e3:.5g}-{high / 1e3:.5g} kHz" for low, high in bands)
    return (
        f"Predicted outside the recorded {recorded}, in kHz, with the standard uncertainty of the last digits: "
        f"resonances {listed('fs')}; antiresonances {listed('fp')}; capacitance {Cs}. Resonances inside the band: see "
        "`derived` in --json."
    )
