"""Numbers as text."""

import numpy as np


def without_exponent(value: float, digits: int) -> str:
    """Return a number with so many significant digits and no exponent: 120 per cent, not 1.2e+02."""
    if not np.isfinite(value) or not 1e-4 <= abs(value) < 1e6:
        return f"{value:.{digits}g}"
    return np.format_float_positional(value, precision=digits, unique=False, fractional=False, trim="-")


def signed(value: float, places: int) -> str:
    """Return a number with its sign and so many decimal places: +0.0, but never -0.0."""
    return f"{round(value, places) + 0.0:+.{places}f}"
