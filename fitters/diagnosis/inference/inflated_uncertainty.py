"""Uncertainties that count what may be there unseen."""

from dataclasses import replace
from math import hypot, sqrt

from ...interface import Constant
from ..findings import Diagnosis, NotDecidable

_UNIFORM = 1 / sqrt(3)
"""Standard deviation about zero of what lies anywhere between zero and a limit, in limits (JCGM 100:2008, 4.3.7)."""


def widened(diagnosis: Diagnosis) -> Diagnosis:
    """Return the diagnosis with the standard uncertainties of its final constants widened, and a sentence that says so.

    Each effect that cannot be decided may have any size up to its upper limit; what it would have shifted a constant
    by, its real and its imaginary part, is taken as a further uncertainty of that constant.
    """
    constants = {name: _wider(name, own, diagnosis) for name, own in diagnosis.final.constants.items()}
    final = replace(diagnosis.final, constants=constants)
    return replace(diagnosis, final=final, says=(*diagnosis.says, _says(diagnosis)))


def _wider(name: str, own: Constant, diagnosis: Diagnosis) -> Constant:
    def hidden(key: str, value: float) -> list[float]:
        return [_UNIFORM * abs(entry.shifts.get(key, 0.0) * value) for entry in diagnosis.not_decidable]

    re, im = hidden(name, own.re), hidden(f"{name}.im", own.im)
    wider = own if own.u_re is None or not any(re) else replace(own, u_re=hypot(own.u_re, *re))
    return wider if own.u_im is None or not any(im) else replace(wider, u_im=hypot(own.u_im, *im))


def _says(diagnosis: Diagnosis) -> str:
    if not diagnosis.not_decidable:
        return "Nothing that could be there unseen would widen an uncertainty."
    names = ", ".join(dict.fromkeys(_named(entry) for entry in diagnosis.not_decidable))
    return f"The uncertainties count what may be there unseen: {names}."


def _named(entry: NotDecidable) -> str:
    return f"{entry.effect} at {entry.where}"
