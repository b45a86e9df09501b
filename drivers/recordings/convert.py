"""The measurement parameters of an impedance analyzer, and the complex impedance for each pair of numbers.

The names are the 4294A's (programming manual, command MEAS), the definitions those of the Impedance Measurement
Handbook: Z = Rs + jX, Y = G + jB, Q = |X|/Rs = |B|/G, D = 1/Q.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np

from ...models.base.arrays import Impedances, Reals

_ROUNDING = 1e-5
"""Amount by which |X|/|Z| may exceed 1: two numbers rounded to seven digits, with a margin."""


def _z(r: Reals, x: Reals) -> Impedances:
    return r + 1j * x


def _y(g: Reals, b: Reals) -> Impedances:
    return np.asarray(1 / (g + 1j * b), dtype=np.complex128)


def _rest(whole: Reals, part: Reals) -> Reals:
    """Return the other leg of a right triangle, taken as positive (passive device), or NaN if there is none."""
    square = 1 - (part / whole) ** 2
    return whole * np.sqrt(np.where(abs(square) < 2 * _ROUNDING, np.maximum(square, 0), square))


def _polar(size: Reals, phase: Reals) -> Impedances:
    return np.asarray(size * np.exp(1j * phase), dtype=np.complex128)


Conversion = Callable[[Reals, Reals, Reals], Impedances]
"""(angular frequency in rad/s, first number, second number) -> impedance in ohm; SI units, phase in radians."""

CONVERSIONS: Mapping[str, Conversion] = MappingProxyType(
    {
        "IMPH": lambda w, z, phase: _polar(z, phase),
        "AMPH": lambda w, y, phase: 1 / _polar(y, phase),
        "IRIM": lambda w, r, x: _z(r, x),
        "ARIM": lambda w, g, b: _y(g, b),
        "LSR": lambda w, ls, rs: _z(rs, w * ls),
        "LSQ": lambda w, ls, q: _z(abs(w * ls) / q, w * ls),
        "CSR": lambda w, cs, rs: _z(rs, -1 / (w * cs)),
        "CSQ": lambda w, cs, q: _z(abs(1 / (w * cs)) / q, -1 / (w * cs)),
        "CSD": lambda w, cs, d: _z(abs(1 / (w * cs)) * d, -1 / (w * cs)),
        "LPG": lambda w, lp, g: _y(g, -1 / (w * lp)),
        "LPQ": lambda w, lp, q: _y(abs(1 / (w * lp)) / q, -1 / (w * lp)),
        "LPR": lambda w, lp, rp: _y(1 / rp, -1 / (w * lp)),
        "CPG": lambda w, cp, g: _y(g, w * cp),
        "CPQ": lambda w, cp, q: _y(abs(w * cp) / q, w * cp),
        "CPD": lambda w, cp, d: _y(abs(w * cp) * d, w * cp),
        "CPR": lambda w, cp, rp: _y(1 / rp, w * cp),
        "IMLS": lambda w, z, ls: _z(_rest(z, w * ls), w * ls),
        "IMCS": lambda w, z, cs: _z(_rest(z, 1 / (w * cs)), -1 / (w * cs)),
        "IMLP": lambda w, z, lp: _y(_rest(1 / z, 1 / (w * lp)), -1 / (w * lp)),
        "IMCP": lambda w, z, cp: _y(_rest(1 / z, w * cp), w * cp),
    }
)
"""Parameters that determine Z from two real numbers. COMP (both traces complex) needs no conversion."""

SIGN_LOST: Mapping[str, str] = MappingProxyType(
    {"IMRS": "|Z| and Rs", "IMQ": "|Z| and Q", "IMD": "|Z| and D"},
)
"""Parameters that do not determine whether X is inductive or capacitive."""

RESISTANCE_WEAK = ("IMLS", "IMCS", "IMLP", "IMCP")
"""Parameters that give the resistive part only as a small difference of large numbers, without its sign."""


_LOSS_BESIDE_REACTANCE = ("LSQ", "CSQ", "CSD", "LPQ", "CPQ", "CPD")
_SURELY = 0.9


def loss_is_signed(parameter: str, a: Reals, b: Reals) -> bool:
    """Return whether Q or D carries the sign of the reactance beside it, as some meters write it (D = G/B).

    It does if nearly all of its numbers have the sign of the reactance and both signs occur; read as a size, it would
    give every point of one kind a negative resistance.
    """
    if parameter not in _LOSS_BESIDE_REACTANCE or np.all(a > 0) or np.all(a < 0):
        return False
    alike = np.sign(a) == np.sign(b)
    return all(np.count_nonzero(alike & part) > _SURELY * np.count_nonzero(part) for part in (a > 0, a < 0))


def to_impedance(parameter: str, frequency: Reals, a: Reals, b: Reals) -> Impedances:
    """Return Z in ohm, shape (N,), from the two numbers of `parameter`, SI units and radians, at `frequency` in Hz.

    Of a signed Q or D (`loss_is_signed`) the size is used. Z is not finite if two numbers determine no impedance
    (Cs = 0, |X| above |Z|). Raises KeyError for an unknown parameter.
    """
    if loss_is_signed(parameter, a, b):
        b = np.abs(b)
    with np.errstate(all="ignore"):
        return np.asarray(CONVERSIONS[parameter](2 * np.pi * frequency, a, b), dtype=np.complex128)
