"""Glues, matching layers, foils, electrodes, backings and fluids."""

import math

from ..build import Quantity
from .material import Material, elastic
from .temperature import ideal_gas, water

_THESIS = "Tjelde, NTNU 2012, table 4.1 (data sheet)"
_GLUE = "Tjelde, NTNU 2012, table 4.7: rho c^2 = 6.86 GPa, Q 13; density 1150 kg/m3 assumed"
_THURNER = "stephanthurner, public model files"
_HANDBOOK = "handbook value"
_E494 = "ASTM E494, tables X3.1 and X3.2"
_METAL_Q = "Q is a lower bound"
_CASCADED = "IEEE TUFFC 64 (2017) 1078, table I (PMC5568756)"


def _decibels_q(dB_cm_MHz: float, speed: float) -> float:
    """Return Q = pi f / (alpha c) of an attenuation in dB/cm/MHz."""
    return math.pi * 1e6 / (dB_cm_MHz * 100 * math.log(10) / 20 * speed)


def _metal(density: float, speed: float) -> dict[str, Quantity]:
    return elastic(speed, 1000, f"{_E494}; {_METAL_Q}", density=density, u=0.02)


def _fluid(density: float, speed: float, q: float, source: str, u: float = 0.003) -> dict[str, Quantity]:
    return elastic(speed, q, source, density=density, u=u)


def _backing(z_MRayl: float, u_MRayl: float, source: str) -> dict[str, Quantity]:
    return {"z": Quantity(z_MRayl * 1e6, u=u_MRayl * 1e6, source=source)}


def _thesis_layer(z_MRayl: float, u_z: float, c: float, u_c: float, q: float) -> dict[str, Quantity]:
    z = z_MRayl * 1e6
    return {
        "density": Quantity(z / c, u=z / c * math.hypot(u_z / z_MRayl, u_c / c), source=_THESIS),
        "z": Quantity(z, u=u_z * 1e6, source=_THESIS),
        "c": Quantity(c, u=u_c, source=_THESIS),
        "q": Quantity(q, u=q / 2, source=_THESIS),
    }


_ELASTIC = (
    Material("epoxy", "elastic", elastic(2200, 10, _THURNER, density=1100, u=0.1), "generic"),
    Material("thesis glue", "elastic", elastic(math.sqrt(6.86e9 / 1150), 13, _GLUE, density=1150, u=0.1)),
    Material("thesis ML1", "elastic", _thesis_layer(10.3, 0.5, 2455, 150, 60)),
    Material("thesis ML2", "elastic", _thesis_layer(2.4, 0.12, 2250, 140, 35)),
    Material(
        "Araldite AW106",
        "elastic",
        elastic(2300, 20, "PMC8157294; Q of the epoxy family", density=1090),
        "with hardener HV953U",
    ),
    Material(
        "silver acrylic tape",
        "elastic",
        elastic(1700, 10, "xMasonV2, an optimised value; Q of filled polymers", density=1800, u=0.1, u_q=1.0),
    ),
    Material(
        "epoxy unloaded",
        "elastic",
        elastic(2680, _decibels_q(0.46, 2680), f"{_CASCADED}: 3.1 MRayl, 0.46 dB/cm/MHz", z=3.1e6),
        "a transducer epoxy as measured",
    ),
    Material(
        "alumina epoxy",
        "elastic",
        elastic(2800, _decibels_q(5.3, 2800), f"{_CASCADED}: 25 % Al2O3, 5.6 MRayl, 5.3 dB/cm/MHz", z=5.6e6, u=0.1),
        "matching layer, 25 % by volume",
    ),
    Material("alumina", "elastic", elastic(9970, 1000, f"{_E494}; {_METAL_Q}", density=3700), "extruded, sintered"),
    Material("aluminium", "elastic", _metal(2700, 6300)),
    Material("brass", "elastic", _metal(8100, 4370)),
    Material("steel", "elastic", _metal(7700, 5900)),
    Material("stainless steel", "elastic", _metal(7910, 5790), "type 347"),
    Material("titanium", "elastic", _metal(4540, 6240)),
    Material("tungsten", "elastic", _metal(19100, 5460)),
    Material("polyimide", "elastic", elastic(2414, 30, f"{_THURNER}; Q of polymers", density=1421), "Kapton"),
    Material("Mylar", "elastic", elastic(2540, 30, f"{_THURNER}; Q of polymers", density=1180), "as published"),
)
_ELECTRODES = (
    Material(
        "silver", "electrode", elastic(3650, 250, _HANDBOOK, density=10490), "bulk; fired paste is 6000-9000 kg/m3"
    ),
    Material("gold", "electrode", elastic(3240, 250, _HANDBOOK, density=19300), "bulk"),
    Material("copper", "electrode", elastic(4760, 250, _HANDBOOK, density=8960), "bulk"),
    Material("nickel", "electrode", elastic(6040, 250, _HANDBOOK, density=8902), "bulk"),
    Material("silver ink", "electrode", elastic(3600, 50, f"{_THURNER}; Q assumed", density=3400, u=0.1, u_q=1.0)),
    Material("silver epoxy", "electrode", elastic(1900, 20, f"{_THURNER}; Q assumed", density=2710, u=0.1, u_q=1.0)),
)
_BACKINGS = (
    Material(
        "tungsten epoxy",
        "backing",
        _backing(6.2, 1.8, "3.04-9.37 MRayl at 12-32 % porosity, researcher.life abstract"),
        "known by its impedance alone",
    ),
    Material("filled epoxy", "backing", _backing(9.0, 3.5, "3-15 MRayl, Birmingham thesis 2009"), "impedance alone"),
    Material(
        "photocured resin",
        "backing",
        _backing(3.6, 1.5, "0.88-6.25 MRayl, Troge, JASA 128 (2010) 2704"),
        "filled with BaSO4 or microspheres; known by its impedance alone",
    ),
)
_FLUIDS = (
    Material(
        "air",
        "fluid",
        _fluid(1.204, 343.2, 1e3, "dry air, 20 C, 101.3 kPa; Q lower bound", 0.02),
        temperature=ideal_gas(),
    ),
    Material(
        "water",
        "fluid",
        _fluid(998.2, 1482.3, 1e4, "20 C; speed: Marczak, JASA 102 (1997) 2776"),
        temperature=water(),
    ),
    Material(
        "vacuum",
        "fluid",
        {"z": Quantity(0.0, source="definition"), "density": Quantity(0.0, source="definition")},
        "a free face",
    ),
)

USUAL_POISSON = Quantity(0.35, u=0.05, source="usual: metals 0.28 to 0.35, polymers 0.35 to 0.42")
"""Poisson's ratio of an elastic layer of which nothing is known."""

PASSIVE: tuple[Material, ...] = (*_ELASTIC, *_ELECTRODES, *_BACKINGS, *_FLUIDS)
"""Every material of the library that is not piezoelectric."""
