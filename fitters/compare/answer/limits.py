"""Limits on undetected changes, and the repeatability of the recordings by band."""

from dataclasses import replace

import numpy as np

from ....models.base.arrays import Complexes, j_omega
from ...diagnosis.findings import Size
from ..change import DEVICE, TERMINALS
from ..comparison import Limit, Repeatability
from ..errors.pair_errors import PairErrors
from ..hypotheses.fitted import Fitted
from ..pair import Pair

_BANDS = 8
_AT_95 = 1.96
_WIDE = 1e3
"""Prior standard deviation of a size that only the pair should limit, in units that move ln Z by one at some point."""


def limits(errors: PairErrors, fit: Fitted) -> tuple[Limit, ...]:
    """Return the largest possible size of each small element at the terminals beside the changes found, at 95 %.

    A second element of a kind that was found would only share its size with the first one, so it has no limit.
    """
    pair = errors.pair
    Z, jw = fit.at.predicted, j_omega(pair.frequency)
    one = np.ones_like(Z)
    columns = {
        ("lead-inductance", "inductance", "H"): jw / Z,
        ("series-resistance", "resistance", "ohm"): one / Z,
        ("stray-capacitance", "capacitance", "F"): -jw * Z,
        ("leakage", "conductance", "S"): -Z,
        ("frequency-shift", "shift", "1"): -fit.at.through * errors.slope,
    }
    made: list[Limit] = []
    for (effect, name, unit), column in columns.items():
        if effect in fit.hypothesis.names:
            continue
        size, u = _limited(errors, fit, column)
        where = DEVICE if effect == "frequency-shift" else TERMINALS
        made.append(Limit(effect, where, {name: Size(abs(size) + _AT_95 * u, u, unit)}))
    return tuple(made)


def _limited(errors: PairErrors, fit: Fitted, column: Complexes) -> tuple[float, float]:
    """Return the size of a column estimated from the pair, with its standard uncertainty, all errors integrated out."""
    scale = _WIDE / float(np.max(np.abs(column)))
    at = replace(
        fit.at,
        slopes=np.column_stack([fit.at.slopes, column * scale]),
        x=np.append(fit.at.x, 0.0),
    )
    outcome = fit.errors.outcome(at, (fit.outcome.sizes.rest,), fit.outcome.sizes)
    return float(outcome.x[-1]) * scale, float(np.sqrt(outcome.covariance[-1, -1])) * scale


def repeatability(pair: Pair) -> tuple[Repeatability, ...]:
    """Return the difference of the recordings in bands of equal numbers of points."""
    kept = np.arange(pair.frequency.size)
    made: list[Repeatability] = []
    for block in np.array_split(kept, _BANDS):
        change = pair.change[block]
        noise2 = pair.noise_before[block] ** 2 + pair.noise_after[block] ** 2
        made.append(
            Repeatability(
                (float(pair.frequency[block[0]]), float(pair.frequency[block[-1]])),
                float(np.sqrt(np.mean(change.real**2))),
                float(np.sqrt(np.mean(change.imag**2))),
                float(np.sqrt(np.mean(noise2))),
            )
        )
    return tuple(made)
