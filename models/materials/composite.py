"""1-3 composites: rods of a poled ceramic in a polymer, as one effective piezoelectric material.

Smith and Auld, Modeling 1-3 composite piezoelectrics: thickness-mode oscillations, IEEE Trans. UFFC 38 (1991) 40.
"""

from dataclasses import dataclass

from ..base.errors import PzctlError
from ..constants.piezo_constants import Thickness
from ..constants.tensor import Tensor6mm


class CompositeError(PzctlError):
    """A composite that cannot exist."""


@dataclass(frozen=True)
class Polymer:
    """The isotropic filler of a composite; complex, SI."""

    c11: complex
    """Pa: density times the longitudinal speed squared."""
    c12: complex
    """Pa: c11 less twice the shear modulus."""
    eps: complex
    """F/m."""
    density: float
    """kg/m3."""


def composite_1_3(
    ceramic: Tensor6mm, ceramic_density: float, polymer: Polymer, fraction: float
) -> tuple[float, Thickness]:
    """Return density (kg/m3) and thickness mode of a 1-3 composite with a volume fraction of rods.

    Both phases have the same strain along the rods and the same stress across them, and the composite as a whole is
    clamped sideways. Valid for rods that are much finer than the thickness. Raises CompositeError.
    """
    if not 0 < fraction < 1:
        raise CompositeError(f"1-3 composite: the volume fraction of the ceramic is {fraction:g}; 0 to 1 is possible")
    v, w = fraction, 1 - fraction
    across = v * (polymer.c11 + polymer.c12) + w * (ceramic.c11E + ceramic.c12E)
    between = 2 * w * (ceramic.c13E - polymer.c12)
    c33E = v * (ceramic.c33E - between * (ceramic.c13E - polymer.c12) / across) + w * polymer.c11
    e33 = v * (ceramic.e33 - between * ceramic.e31 / across)
    eps33S = v * (ceramic.eps33S + 2 * w * ceramic.e31**2 / across) + w * polymer.eps
    density = v * ceramic_density + w * polymer.density
    return density, Thickness.from_e_form(c33E, e33, eps33S)
