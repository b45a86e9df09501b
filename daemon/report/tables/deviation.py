"""The deviation of a fitted constant from its data sheet, in per cent and in joint standard uncertainties."""

from typing import Literal

from ....models.build import Quantity

Verdict = Literal["held", "near", "off", "far", ""]
"""`near`: within one joint standard uncertainty; `off`: within two; `far`: beyond; empty: nothing to compare with."""
_MOST = 1e6
"""Per cent, or uncertainties, from which a deviation is written with an exponent."""


def deviation(re: float, u: float | None, nominal: Quantity | None, free: bool) -> tuple[str, Verdict]:
    """Return the deviation of a constant's real part as text, `+2.1 % (0.8 u)`, and its verdict."""
    if not free:
        return "held", "held"
    if nominal is None or not nominal.re:
        return "", ""
    away = 100 * (re / nominal.re - 1)
    percent = f"{round(away, 1) + 0.0:+.1f} %" if abs(away) < _MOST else f"{away:+.1e} %"  # + 0.0: never -0.0
    both = ((u or 0.0) ** 2 + nominal.u**2) ** 0.5
    if not both:
        return percent, ""
    sigmas = abs(re - nominal.re) / both
    shown = f"{sigmas:.1f}" if sigmas < _MOST else f"{sigmas:.1e}"
    return f"{percent} ({shown} u)", "far" if sigmas > 2 else "off" if sigmas > 1 else "near"
