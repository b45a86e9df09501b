"""Random specimens: soft and hard ceramics, polymer films, 1-3 composites, and what is glued to them."""

import numpy as np

from ..distributions import lognormal, loguniform
from .specimen import AIR, EPS0, Ceramic, Kind, LabDevice, LabLayer, Told

_MATERIALS: dict[str, tuple[Kind, float, float, float, float, float, float, float]] = {
    # kind, weight, density, c33D (GPa), h33 (1e8 V/m), eps33S/eps0, Q, tan d
    "Pz27": ("soft", 5.0, 7700.0, 144.4, 19.84, 913.7, 80.0, 0.017),
    "PZT-5A": ("soft", 1.5, 7750.0, 145.0, 21.5, 830.0, 75.0, 0.018),
    "PZT-5H": ("soft", 1.0, 7800.0, 160.0, 19.5, 1350.0, 60.0, 0.022),
    "PIC255": ("soft", 1.0, 7800.0, 154.0, 23.5, 743.0, 90.0, 0.016),
    "hard PZT": ("hard", 1.5, 7650.0, 160.0, 25.0, 640.0, 600.0, 0.004),
    "PVDF": ("film", 0.6, 1880.0, 11.3, -47.0, 5.3, 20.0, 0.12),
    "1-3 composite": ("composite", 0.8, 4300.0, 65.0, 20.5, 420.0, 30.0, 0.020),
}
"""Nominal values that the ceramics scatter around: typical of data sheets, but not of a particular one."""
_IN_LIBRARY = ("Pz27", "PZT-5A", "PIC255")
_GLUE = 2.9e6, 2550.0, 30.0


def random_specimen(rng: np.random.Generator, name: str, steps: int, backed: bool, ceramic_only: bool) -> LabDevice:
    """Return a specimen with `steps` gluing steps; `ceramic_only`: a soft or hard ceramic, no film, no composite."""
    names = [m for m, of in _MATERIALS.items() if of[0] in ("soft", "hard") or not (ceramic_only or steps > 1)]
    weights = np.array([_MATERIALS[m][1] for m in names])
    material = str(rng.choice(names, p=weights / weights.sum()))
    ceramic = _ceramic(rng, material)
    wide = {"film": (6.0, 10.0), "composite": (12.0, 25.0)}.get(ceramic.kind, (10.0, 25.0))
    diameter = round(float(rng.uniform(*wide)), 3) * 1e-3
    layers: list[LabLayer] = []
    for k in range(1, steps):
        layers += [_glue(rng, k), _matching_layer(rng, k, ceramic.f0)]
    back = float(rng.uniform(3e6, 7e6)) if backed else AIR
    told = _told(rng, material, ceramic, diameter)
    return LabDevice(name, diameter, ceramic, tuple(layers), back, AIR, ("disk", "ml1", "ml2")[:steps], told)


def _ceramic(rng: np.random.Generator, material: str) -> Ceramic:
    kind, _, density, c, h, eps, q, tan_d = _MATERIALS[material]
    thin, thick = {"film": (0.02, 0.11), "composite": (0.4, 1.2)}.get(kind, (0.4, 2.0))
    loss = 1 / (q * float(np.exp(rng.normal(0, 0.25))))
    tan_d = tan_d * float(np.exp(rng.normal(0, 0.2)))
    h_phase = {"film": 0.02, "composite": 0.004}.get(kind, 0.003) * float(rng.uniform(-0.3, 1.0))
    return Ceramic(
        kind=kind,
        thickness=round(loguniform(rng, thin, thick), 5) * 1e-3,
        density=density,
        c33D=c * 1e9 * float(rng.normal(1, 0.03)) * (1 + 1j * loss),
        h33=h * 1e8 * float(rng.normal(1, 0.03)) * (1 - 1j * h_phase),
        eps33S=eps * EPS0 * float(rng.normal(1, 0.05)) * (1 - 1j * tan_d),
    )


def _glue(rng: np.random.Generator, number: int) -> LabLayer:
    """Return a glue whose library values are off by some tens of per cent and stated as exact."""
    z, c, q = _GLUE
    true = (z * float(np.exp(rng.normal(0, 0.2))), c * float(np.exp(rng.normal(0, 0.12))))
    thickness = lognormal(rng, 8e-6, 0.4)
    stated_thickness = max(thickness + float(rng.normal(0, 4e-6)), 2e-6)
    return LabLayer(
        f"glue{number}",
        thickness,
        *true,
        q * float(np.exp(rng.normal(-0.4, 0.5))),
        True,
        (stated_thickness, z, c, q),
        (4e-6, 0.0, 0.0, 0.0),
    )


def _matching_layer(rng: np.random.Generator, number: int, f0: float) -> LabLayer:
    z, c, q = (10.3e6, 2455.0, 40.0) if number == 1 else (3.3e6, 2400.0, 35.0)
    thickness = float(rng.uniform(0.6, 1.1)) * c / (4 * f0)
    u = (1e-6, 0.08 * z, 0.1 * c, 25.0)
    told = round(thickness + float(rng.normal(0, u[0])), 9)
    true = (z * float(rng.normal(1, 0.04)), c * float(rng.normal(1, 0.03)), float(rng.uniform(20, 60)))
    return LabLayer(f"ml{number}", thickness, *true, False, (told, z, c, q), u)


def _told(rng: np.random.Generator, material: str, ceramic: Ceramic, diameter: float) -> Told:
    """Return the values of the build file: sizes off within their uncertainty, nominal values of the material."""
    u_t = 1e-6 if ceramic.kind != "film" else max(0.01 * ceramic.thickness, 2e-7)
    u_d = float(rng.choice([0.0, 5e-6, 2e-5]))
    _, _, density, c, h, eps, q, tan_d = _MATERIALS[material]
    values = (
        ("density_kg_m3", density, 0.0, 0.0),
        ("c33D_1e10_Pa", c / 10, c / 10 / q, 0.05 * c / 10),
        ("h33_1e8_V_m", h, 0.0, 0.05 * abs(h)),
        ("eps33S_r", eps, -eps * tan_d, 0.1 * eps),
    )
    return Told(
        material=material if material in _IN_LIBRARY else "",
        thickness=round(ceramic.thickness + float(rng.normal(0, u_t)), 9),
        thickness_u=u_t,
        diameter=round(diameter + float(rng.normal(0, u_d)), 9),
        diameter_u=u_d,
        values=(("density_kg_m3", density, 0.0, 0.0),) if material in _IN_LIBRARY else values,
    )
