"""The resonances common to both recordings and their shifts at the terminals, whatever the cause."""

import numpy as np

from ....models.base.arrays import Complexes, Impedances, Reals
from ...diagnosis.data_quality.pole_fit import PoleFit
from ..comparison import ResonanceShift
from ..pair import Pair
from ..resonances import resonances_of

_NEAR = 3.0
"""Distance within which two poles are the same, in half widths of the wider one or in per cent of the frequency."""
_KNOWN = 0.5
"""Uncertainty of a shift, in half widths, above which a resonance is omitted."""


def resonance_shifts(pair: Pair, before: PoleFit, after: PoleFit) -> tuple[ResonanceShift, ...]:
    """Return the resonances of both recordings with shift of frequency, ratio of Q and of strength."""
    first, second = (_told(fit, pair, Z) for fit, Z in ((before, pair.before), (after, pair.after)))
    made: list[ResonanceShift] = []
    taken: set[int] = set()
    strengths: Reals = np.abs(first[1] / first[0].real)
    for k in sorted(range(strengths.size), key=lambda k: -strengths[k]):  # the strongest choose first
        p = first[0][k]
        free = [j for j in range(second[0].size) if j not in taken]
        if not free:
            break
        j = min(free, key=lambda j: abs(second[0][j] - p))
        other = second[0][j]
        if abs(other.imag - p.imag) > _NEAR * max(-p.real, -other.real, 0.01 * p.imag):
            continue
        taken.add(j)
        one = _shift((p, first[1][k], first[2][k]), (other, second[1][j], second[2][j]))
        if 2 * one.q * one.u_shift < _KNOWN:
            made.append(one)
    return tuple(sorted(made, key=lambda one: one.frequency_Hz))


def _told(fit: PoleFit, pair: Pair, Z: Impedances) -> tuple[Complexes, Complexes, Reals]:
    """Return poles, residues, and the standard uncertainties of ln width and frequency, shape (P, 2)."""
    own = resonances_of(fit, pair.frequency, Z)
    J = fit.tangent()
    covariance = np.linalg.pinv(J.T @ J, rcond=1e-12) * max(1.0, fit.chi2_per_dof)
    sd = np.sqrt(np.maximum(np.diag(covariance), 0.0))
    middle = float(np.sqrt(pair.frequency[0] * pair.frequency[-1]))
    count = fit.poles.size
    at = [int(np.argmin(np.abs(fit.poles * middle - p))) for p in own.poles]
    u = np.array([[sd[k], sd[count + k] * -fit.poles[k].real * middle] for k in at]).reshape(len(at), 2)
    return own.poles, own.residues, u


def _shift(first: tuple[complex, complex, Reals], second: tuple[complex, complex, Reals]) -> ResonanceShift:
    (p, r, u), (other, now, v) = first, second
    size, to = abs(p), abs(other)
    q, q_now = size / (-2 * p.real), to / (-2 * other.real)
    u_width = float(np.hypot(u[0], v[0]))
    # A branch's capacitance is 2 |r| Im p / |p|^3, and |r| has the uncertainty of its width.
    strength = abs(now) * other.imag / to**3 / (abs(r) * p.imag / size**3)
    return ResonanceShift(
        frequency_Hz=float(size),
        q=float(q),
        shift=float(to / size - 1),
        u_shift=float(np.hypot(u[1] / size, v[1] / to)),
        q_ratio=float(q_now / q),
        u_q_ratio=float(q_now / q * u_width),
        strength_ratio=float(strength),
        u_strength_ratio=float(strength * u_width),
    )
