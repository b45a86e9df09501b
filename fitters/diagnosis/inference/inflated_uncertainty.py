"""Standard uncertainties that include effects which may be present undetected."""

from dataclasses import replace
from math import hypot, sqrt

from ...interface import Constant
from ..findings import Diagnosis, NotDecidable

_UNIFORM = 1 / sqrt(3)
"""Root mean square of a uniform distribution from zero to a limit, in limits (JCGM 100:2008, 4.3.7): the constants told
are those without the effect."""


def widened(diagnosis: Diagnosis) -> Diagnosis:
    """Return the diagnosis with inflated standard uncertainties of the final constants, and a sentence about it.

    Each undetectable effect may have any size up to its upper limit; the shift of the real and imaginary part of a
    constant that it could cause is added in quadrature as a further uncertainty.
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
