"""Laws of a part of the area: the rest of it is as without them. So act a drop on a face and a bond that has come off.

Both parts are in parallel: Y = (1 - share) Y(without) + share Y(with the law).
"""

from collections.abc import Mapping

import numpy as np

from ...base.arrays import Complexes, Reals
from ..base.assembly import Assembly
from ..base.effect import EffectParameter, Stage
from .corrections import Correction, Place, Quantity, corrected
from .laws import Law, Values

SHARE = "share"
"""Name of the part of the area, which is the size of such a law."""
_SHARE = EffectParameter(SHARE, "1", typical=0.01, upper=0.95, prior=(0.03, 1.3))
_LIGHTEST, _HEAVIEST = 0.01, 30.0
"""Limits of an inertance on a part of a face, in units of the active layer's impedance: pi is its own mass."""
_OPEN = 1e6
"""Compliance of a gap, in units of the active layer's: no stress passes."""


def _inertance(x: Reals, values: Values) -> Complexes:
    return np.asarray(1j * x * values["size"], np.complex128)


def _gap(x: Reals, _: Values) -> Complexes:
    return np.asarray(_OPEN * 1j * x, np.complex128)


_OF_PARTS: Mapping[Quantity, tuple[Law, ...]] = {
    "impedance": (
        Law(
            "part-inertance",
            (_SHARE, EffectParameter("size", "1", typical=0.3, lower=_LIGHTEST, upper=_HEAVIEST, null=1.0)),
            _inertance,
            "an inertance of {size} on {share} of the area",
        ),
    ),
    "compliance": (Law("part-gap", (_SHARE,), _gap, "a gap on {share} of the area, which no stress crosses"),),
}


def laws_of_parts(quantity: Quantity) -> tuple[Law, ...]:
    """Return the laws of a part of the area: of a face, and between two layers."""
    return _OF_PARTS.get(quantity, ())


def stage_of(place: Place, law: Law) -> Stage:
    """Return the stage at which a law at a place acts."""
    return Stage.SHARES if law in laws_of_parts(place.quantity) else place.stage


def corrected_on_part(assembly: Assembly, place: Place, g: Correction, share: float) -> Assembly:
    """Return the device with a correction on this part of its area."""
    rest = tuple(part.share(1 - share) for part in assembly.parts)
    on = corrected(assembly.with_parts(tuple(part.share(share) for part in assembly.parts)), place, g)
    return assembly.with_parts((*rest, *on.parts))
