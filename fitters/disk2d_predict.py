"""What a fitted disk predicts where it was not recorded: resonances, antiresonances, capacitance."""

from collections.abc import Mapping, Sequence

import numpy as np
from scipy.signal import find_peaks

from ..models.arrays import Frequencies, Reals, j_omega
from ..models.disk2d.model import Disk2D
from .interface import Constant

_POINTS = 4000
_PROMINENT = 0.01
# Logarithm of Re Y or Re Z by which a peak stands out.
_STEP = 1e-5
_LOW = 1e3
# Hz, of the capacitance: where meters measure it.


def predictions(
    model: Disk2D, names: Sequence[str], covariance: Reals, low: float, high: float
) -> Mapping[str, Constant]:
    """Return resonances `fs1`, `fs2`, ... and antiresonances `fp1`, ... in Hz between two frequencies, by full name.

    Resonances are maxima of Re Y, antiresonances those of Re Z, counted from `low` upwards; every mode of the disk that
    shows is among them: radial, edge, thickness. `capacitance` is that at 1 kHz in F, complex. Standard uncertainties
    follow from `covariance`, shape (P, P), of the parameters `names`: near a zero or a pole f0 of Z, ln Z is
    +-ln(f - f0) but for what is smooth, so df0/dp = -(d ln Z/dp)/(d ln Z/df).
    """
    at: Frequencies = np.linspace(low, high, _POINTS)
    Z = model.impedance(at)
    places = {"fs": _peaks(at, (1 / Z).real), "fp": _peaks(at, Z.real)}
    f: Frequencies = np.sort(np.concatenate([[_LOW], *places.values()]))
    mine = model.parameters()
    moving = [k for k, name in enumerate(names) if name in mine and covariance[k, k] > 0]
    own, slopes = model.jacobian(f, [names[k] for k in moving])
    by_f = np.log(model.impedance(f * (1 + _STEP)) / model.impedance(f * (1 - _STEP))) / (2 * _STEP * f)
    inner = covariance[np.ix_(moving, moving)]
    shift = -(slopes / by_f).real
    spread = np.sqrt(np.maximum(np.einsum("kn,kl,ln->n", shift, inner, shift), 0.0))
    made: dict[str, Constant] = {}
    for kind, found in places.items():
        for order, (place, u) in enumerate(zip(found, spread[np.searchsorted(f, found)], strict=True), 1):
            made[f"{model.name}.{kind}{order}"] = Constant(float(place), 0.0, float(u), 0.0, "Hz")
    C = complex(1 / (j_omega(f[:1]) * own[:1])[0])
    u = [float(np.sqrt(max(0.0, part @ inner @ part))) for g in [-slopes[:, 0] * C] for part in (g.real, g.imag)]
    return made | {f"{model.name}.capacitance": Constant(C.real, C.imag, u[0], u[1], "F")}


def _peaks(frequency: Frequencies, values: Reals) -> Frequencies:
    """Return where positive values have their maxima, between the points by a parabola through the logarithms."""
    level = np.log(np.maximum(values, np.finfo(float).tiny))
    there, _ = find_peaks(level, prominence=_PROMINENT)
    left, top, right = level[there - 1], level[there], level[there + 1]
    return frequency[there] + (left - right) / (2 * (left - 2 * top + right)) * (frequency[1] - frequency[0])


def sentence(made: Mapping[str, Constant], layer: str, bands: str) -> str:
    """Return resonances and antiresonances in a sentence."""

    def listed(kind: str) -> str:
        return " ".join(f"{c.re / 1e3:.1f}" for name, c in made.items() if name.startswith(f"{layer}.{kind}"))

    C = made[f"{layer}.capacitance"]
    return (
        f"Predicted, most of it outside the recorded {bands}: resonances at {listed('fs')} kHz, antiresonances at "
        f"{listed('fp')} kHz, capacitance at 1 kHz {C.re * 1e9:.4g} nF (1 - {-C.im / C.re:.2g}j). Their uncertainties "
        "stand among the derived constants (--json)."
    )
