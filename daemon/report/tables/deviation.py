"""The deviation of a fitted constant from its data sheet, in per cent and in joint standard uncertainties."""

from collections.abc import Mapping
from typing import Any, Literal, cast

from ....fitters.interface import Constant, is_undetermined
from ....models.base.plain_numbers import signed
from ....models.build import Quantity

Verdict = Literal["held", "near", "off", "far", ""]
"""`near`: within one joint standard uncertainty; `off`: within two; `far`: beyond; empty: nothing to compare with."""
_MOST = 1e6
"""Per cent, or uncertainties, from which a deviation is written with an exponent."""


def deviation(name: str, constant: Constant, nominal: Quantity | None) -> tuple[str, Verdict]:
    """Return the deviation of a constant's real part as text, `+2.1 % (0.8 u)`, and its verdict."""
    if not constant.free:
        return "held", "held"
    if nominal is None or not nominal.re or is_undetermined(name, constant):
        return "", ""
    away = 100 * (constant.re / nominal.re - 1)
    percent = f"{signed(away, 1)} %" if abs(away) < _MOST else f"{away:+.1e} %"
    both = ((constant.u_re or 0.0) ** 2 + nominal.u**2) ** 0.5
    if not both:
        return percent, ""
    sigmas = abs(constant.re - nominal.re) / both
    shown = f"{sigmas:.1f}" if sigmas < _MOST else f"{sigmas:.1e}"
    return f"{percent} ({shown} u)", "far" if sigmas > 2 else "off" if sigmas > 1 else "near"


def shift_text(name: str, shift: float, constants: Mapping[str, Any]) -> str:
    """Return `disk.c33D -0.4 %` for a relative shift; of a part that is zero within 2 u, `disk.h33.im +1.3 u`.

    `constants` are those of a diagnosis as JSON; `name` ends in `.im` for an imaginary part.
    """
    part = "im" if name.endswith(".im") else "re"
    found = constants.get(name.removesuffix(".im"))
    constant = cast("dict[str, Any]", found) if isinstance(found, dict) else {}
    value, u = constant.get(part), constant.get(f"u_{part}")
    if isinstance(value, int | float) and isinstance(u, int | float) and abs(value) < 2 * u:
        return f"{name} {shift * value / u:+.2g} u"
    return f"{name} {100 * shift:+.2g} %"
