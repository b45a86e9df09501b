"""A resonance as the admittance of its branch, per farad of its capacitance."""

from ...base.arrays import Complexes


def branch(jw: Complexes, w_k: float, q: float) -> Complexes:
    """Return jw w_k^2/(w_k^2 + (jw)^2 + jw w_k/q), 1/s, shape (N,), from rad/s; its real part is positive for q > 0."""
    return jw * w_k**2 / (w_k**2 + jw * jw + jw * (w_k / q))
