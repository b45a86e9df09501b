"""Resonances that soften and lose more where they move most.

The amplitude of a resonance is the voltage over its motional capacitance C, so that a resonance with twice the Q
softens twice as much. The impedance of its branch grows with a power of the amplitude, 1 by Rayleigh's law:

    1/B = R + jwL + 1/(jwC) + (loss R + 2j softening/(wC)) a^exponent,    a in proportion to level |B|/(wC)
"""

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Reals
from ..change import ChangeSize
from ..resonances import Resonances

_ROUNDS, _AGREED = 40, 1e-9
"""Of Newton's method for the amplitude of a bent resonance."""
_LEAST = 0.05
"""Smallest slope of the equation for the amplitude, relative to that without a bend: beyond, it jumps."""

SIZES = (
    ChangeSize("softening", "1", 0.0, 2e-3, signed=True),
    ChangeSize("loss", "1", 0.0, 0.3, signed=True),
    ChangeSize("exponent", "1", 1.0, 0.3, signed=True, limits=(0.3, 4.0)),
)
Law = tuple[float, float, float]
"""Softening and loss at the amplitude that the strongest resonance would have without them, and the exponent."""


def strongest(own: Resonances) -> int:
    """Return the number of the resonance with the largest peak."""
    return int(np.argmax(np.abs(own.residues / own.poles.real)))


def bent(linear: Resonances, f: Frequencies, law: Law, ratios: tuple[float, float]) -> tuple[Complexes, Complexes]:
    """Return the admittances of the resonances at both levels, S, shape (N, P).

    `linear`: the resonances as they are without amplitude; `ratios`: the levels, relative to that of the law.
    """
    softening, loss, exponent = law
    branch = linear.seen(f)
    reactance = np.abs(linear.poles) ** 2 / (2 * np.abs(linear.residues)) / f[:, None]  # of C, ohm
    peak = np.abs(linear.residues / linear.poles.real)
    k = strongest(linear)
    largest = np.max(np.abs(branch[:, k]) * reactance[:, k])
    change = np.asarray(loss / peak + 2j * softening * reactance, np.complex128)
    first, second = (_at_level(branch, change, ratio / largest * reactance, exponent) for ratio in ratios)
    return first, second


def _at_level(branch: Complexes, change: Complexes, per_admittance: Reals, exponent: float) -> Complexes:
    """Return bent branches, S, shape (N, P), by Newton's method for the amplitude.

    `change`: of the impedance at unit amplitude, ohm; `per_admittance`: amplitude for each S.
    """
    if not np.any(per_admittance):
        return branch
    start = 1 / branch
    a = np.abs(branch) * per_admittance
    for _ in range(_ROUNDS):
        power = a**exponent
        z = start + change * power
        size = np.abs(z)
        slope = size + exponent * power * np.real(np.conj(z) * change) / size
        step = (per_admittance - a * size) / np.maximum(slope, _LEAST * size)
        a = np.clip(a + step, a / 2, 2 * a)
        if np.max(np.abs(step)) < _AGREED:
            break
    return np.asarray(1 / (start + change * a**exponent), np.complex128)
