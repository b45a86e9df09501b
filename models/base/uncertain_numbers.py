"""Numbers as the field writes them: 1.514(3)e11, with the uncertainty in the last digits."""

import math
import re

_EXPONENT = re.compile(r"e(?:\+|(-))0*(\d+)")
_PRECISION = 1e-14
"""Part of a value below which an uncertainty says nothing: a double has 15 digits."""
_LEAST = 1e-300
"""Uncertainties below this are zero."""


def with_uncertainty(value: float, u: float | None) -> str:
    """Return `1.514(3)e11`: the digits in brackets are the standard uncertainty of the last digits shown.

    The uncertainty gets one digit, or two if its first digit is 1. A value without an uncertainty, or with one of 0 or
    below the precision of its number, gets six significant digits; one that is not finite is `-`.
    """
    if not math.isfinite(value):
        return "-"
    if u is None or not max(_PRECISION * abs(value), _LEAST) < u < math.inf:
        return _EXPONENT.sub(r"e\1\2", f"{value:.6g}")
    digits = _digits(u)
    size = int(f"{u:.{digits - 1}e}".partition("e")[2])  # after rounding: 0.0998 is 0.10
    exponent = math.floor(math.log10(abs(value))) if value else 0
    exponent = max(exponent, size)
    last = size - digits + 1
    shown = 0 if -3 <= exponent <= 4 and size <= 2 else exponent
    decimals = max(0, shown - last)
    mantissa = f"{value / 10.0**shown:.{decimals}f}"
    bracket = round(u, -last) if last > shown else u / 10.0**last
    return f"{mantissa}({bracket:.0f})" + (f"e{shown}" if shown else "")


def _digits(u: float) -> int:
    """Return the number of digits of an uncertainty: two if one digit would round it by more than a quarter."""
    return 2 if f"{u:.0e}"[0] == "1" or f"{u:.1e}"[0] == "1" else 1


def complex_with_uncertainty(re: float, im: float, u_re: float | None, u_im: float | None) -> str:
    """Return `1.514(3)e11 + 1.44(2)e9 j`, or for a real constant the first number only."""
    if im == 0 and not u_im:
        return with_uncertainty(re, u_re)
    return f"{with_uncertainty(re, u_re)} {'-' if im < 0 else '+'} {with_uncertainty(abs(im), u_im)} j"
