"""Piezoelectric crystals: cuts of lithium niobate, and a relaxor crystal; thickness mode only."""

import numpy as np

from ..base.arrays import Reals
from ..build import Quantity
from ..constants.piezo_constants import EPS0, Thickness
from .material import Material, ceramics
from .rotated_cut import longitudinal_mode

_KOVACS = "Kovacs, Anhorn, Engan, Visintini, Ruppel, IEEE Ultrasonics Symposium 1990, p. 435"
_SMITH = "Smith and Welsh, J. Appl. Phys. 42 (1971) 2219, as commonly quoted, not read again"
_EXPANSION = "Kim and Smith, J. Appl. Phys. 40 (1969) 4637: expansion 15.4e-6/K and 7.5e-6/K"
_ZHANG = "Zhang, Jiang, Cao, J. Appl. Phys. 90 (2001) 3471, as commonly quoted, not read again"
_STEP_K = 1.0

# Lithium niobate, crystal axes. Stiffness GPa: 11, 12, 13, 14, 33, 44, 66; e C/m2: 15, 22, 31, 33; eps: 11, 33.
_STIFFNESS = np.array([198.39, 54.72, 65.13, 7.88, 227.90, 59.65, 71.835])
_STRESS = np.array([3.69, 2.42, 0.30, 1.77])
_PERMITTIVITY = np.array([45.6, 26.3])
_STIFFNESS_SLOPE = 1e-4 * np.array([-1.74, -2.52, -1.59, -2.14, -1.53, -2.04, -1.43])
_STRESS_SLOPE = 1e-4 * np.array([1.47, 0.79, 2.21, 8.87])
_PERMITTIVITY_SLOPE = 1e-4 * np.array([3.23, 6.27])
_DENSITY_SLOPE = -3.83e-5


def _niobate_mode(angle_deg: float, kelvin: float) -> Thickness:
    """Return the thickness mode of a plate, `kelvin` above 25 C."""
    c11, c12, c13, c14, c33, c44, c66 = 1e9 * _STIFFNESS * (1 + kelvin * _STIFFNESS_SLOPE)
    e15, e22, e31, e33 = _STRESS * (1 + kelvin * _STRESS_SLOPE)
    eps11, eps33 = EPS0 * _PERMITTIVITY * (1 + kelvin * _PERMITTIVITY_SLOPE)
    c: Reals = np.array(
        [
            [c11, c12, c13, c14, 0, 0],
            [c12, c11, c13, -c14, 0, 0],
            [c13, c13, c33, 0, 0, 0],
            [c14, -c14, 0, c44, 0, 0],
            [0, 0, 0, 0, c44, c14],
            [0, 0, 0, 0, c14, c66],
        ]
    )
    e: Reals = np.array([[0, 0, 0, 0, e15, -e22], [-e22, e22, 0, e15, 0, 0], [e31, e31, e33, 0, 0, 0]])
    return longitudinal_mode(c, e, np.diag([eps11, eps11, eps33]), angle_deg)


def _niobate(angle_deg: float) -> dict[str, Quantity]:
    """Return a plate of LiNbO3, Y-cut rotated about X; 90 degrees is the Z-cut. Kovacs gives no losses."""
    plate = _niobate_mode(angle_deg, 0.0)
    values = {"density": 4628 + 0j, "c33D": plate.c33D * (1 + 1e-3j), "h33": plate.h33}
    values["eps33S"] = plate.eps33S * (1 - 1e-3j)
    source = f"{_KOVACS}; Christoffel equation for this cut; Q 1000 and tan d 0.001 assumed"
    # half the difference to the set in Auld, Acoustic Fields and Waves in Solids, 1973: c33E 245 GPa, eps33S 29
    u = {"density": 0.01, "c33D": 0.035, "h33": 0.05, "eps33S": 0.05}
    return {
        name: Quantity(value.real, value.imag, u[name] * abs(value.real), 0.5 * abs(value.imag), source)
        for name, value in values.items()
    }


def _niobate_slopes(angle_deg: float) -> dict[str, Quantity]:
    """Return the temperature coefficients of a plate of LiNbO3, by differences of its thickness mode."""
    below, above = _niobate_mode(angle_deg, -_STEP_K), _niobate_mode(angle_deg, _STEP_K)
    source = f"{_SMITH}; Christoffel equation for this cut; u 20 % assumed"
    slopes = {"density": Quantity(_DENSITY_SLOPE, u=2e-6, source=_EXPANSION)}
    for name in ("c33D", "h33", "eps33S"):
        change = float(np.log(getattr(above, name).real / getattr(below, name).real)) / (2 * _STEP_K)
        slopes[name] = Quantity(change, u=0.2 * abs(change), source=source)
    return slopes


def _pmn_pt() -> dict[str, Quantity]:
    """Return the thickness mode of 0.67PMN-0.33PT poled along [001]: c33E 103 GPa, e33 20.3 C/m2, eps33S 680.

    The other constants are left out: the stiffness matrix is so nearly singular that its rounded values do not give
    back the printed compliances (s33E by 11 %).
    """
    e33, eps33S = 20.3, 680 * EPS0
    plate = Thickness(103e9 + e33**2 / eps33S + 0j, e33 / eps33S + 0j, eps33S + 0j)
    values = {"density": 8060 + 0j, "c33D": plate.c33D * (1 + 0.01j), "h33": plate.h33}
    values["eps33S"] = plate.eps33S * (1 - 0.01j)
    assumed = ceramics(values, f"{_ZHANG}; Q 100 and tan d 0.01 assumed, no losses are printed")
    return {
        name: Quantity(q.re, q.im, q.u, q.u_im if name == "h33" else abs(q.im), q.source) for name, q in assumed.items()
    }


CRYSTALS: tuple[Material, ...] = (
    Material(
        "LiNbO3 36Y",
        "piezo",
        _niobate(36),
        "crystal; 36 degrees rotated Y-cut, thickness mode only",
        _niobate_slopes(36),
    ),
    Material("LiNbO3 Z", "piezo", _niobate(90), "crystal; Z-cut, thickness mode only", _niobate_slopes(90)),
    Material("PMN-33PT", "piezo", _pmn_pt(), "crystal poled along [001]; thickness mode only"),
)
"""Every piezoelectric crystal of the library."""
