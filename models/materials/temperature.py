"""Temperature coefficients: the relative change of a material's constants per kelvin at 25 C, where published."""

import numpy as np
from numpy.polynomial import Polynomial

from ..build import Quantity

ROOM_C = 25.0
WATER_SPEED = Polynomial([1.402385e3, 5.038813, -5.799136e-2, 3.287156e-4, -1.398845e-6, 2.787860e-9])
"""Speed of sound in water, m/s, over temperature in C, 0 to 95 C: Marczak, JASA 102 (1997) 2776."""
_WATER_EXPANSION = 2.57e-4
"""1/K at 25 C: CRC Handbook, density of water."""


def permittivity_slope(per_kelvin: float, source: str) -> dict[str, Quantity]:
    """Return the coefficient of eps33T that a catalogue gives as its mean over -20 to 125 C, with u 25 %.

    The permittivity of a ceramic rises faster than linearly, so that the slope at 25 C is not the mean.
    """
    says = f"{source}: mean over -20 to 125 C; u 25 % as the slope is not constant"
    return {"eps33T": Quantity(per_kelvin, u=0.25 * per_kelvin, source=says)}


def water() -> dict[str, Quantity]:
    """Return the coefficients of water, from its speed and density over temperature."""
    c = float(WATER_SPEED.deriv()(ROOM_C) / WATER_SPEED(ROOM_C))
    speed, density = "slope of Marczak, JASA 102 (1997) 2776, at 25 C", "CRC Handbook, density of water at 25 C"
    return {
        "c": Quantity(c, u=2e-6, source=speed),
        "density": Quantity(-_WATER_EXPANSION, u=1e-6, source=density),
        "z": Quantity(c - _WATER_EXPANSION, u=float(np.hypot(2e-6, 1e-6)), source=f"{speed}; {density}"),
    }


def ideal_gas() -> dict[str, Quantity]:
    """Return the coefficients of an ideal gas at constant pressure: c as sqrt(T), density as 1/T."""
    per_kelvin = 1 / (ROOM_C + 273.15)
    shares = {"c": 0.5, "density": -1.0, "z": -0.5}
    return {
        name: Quantity(share * per_kelvin, u=1e-5, source="ideal gas at constant pressure and 25 C")
        for name, share in shares.items()
    }
