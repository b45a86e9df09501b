"""The deviation of a fitted constant from its data sheet, in per cent and in joint standard uncertainties."""

from typing import Literal

from ....models.build import Quantity

Verdict = Literal["held", "near", "off", "far", ""]
"""`near`: within one joint standard uncertainty; `off`: within two; `far`: beyond; empty: nothing to compare with."""


def deviation(re: float, u: float | None, nominal: Quantity | None, free: bool) -> tuple[str, Verdict]:
    """Return the deviation of a constant's real part as text, `+2.1 % (0.8 u)`, and its verdict."""
    if not free:
        return "held", "held"
    if nominal is None or not nominal.re:
        return "", ""
    percent = f"{round(100 * (re / nominal.re - 1), 1) + 0.0:+.1f} %"  # + 0.0: never -0.0
    both = ((u or 0.0) ** 2 + nominal.u**2) ** 0.5
    if not both:
        return percent, ""
    away = abs(re - nominal.re) / both
    return f"{percent} ({away:.1f} u)", "far" if away > 2 else "off" if away > 1 else "near"
