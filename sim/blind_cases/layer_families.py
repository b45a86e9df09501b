"""Families on the faces, in the bonds and in the layers."""

from dataclasses import replace
from typing import Any

import numpy as np

from .device_under_test import AIR, DeviceUnderTest
from .injected_effect import InjectedEffect, slot_plant
from .scenario import Hidden, Side


def _side(rng: np.random.Generator) -> Side:
    return "back" if rng.random() < 0.5 else "front"


def _faces(specimen: DeviceUnderTest, side: Side, steps: tuple[str, ...]) -> tuple[str, ...]:
    """Return the faces that count as right: a bare disk between equal loads looks the same from both sides."""
    alone = steps == ("disk",) and specimen.back == AIR
    return ("face:back", "face:front") if alone else (f"face:{side}",)


def mass(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant electrodes of some mass: on one face or on both."""
    both = bool(rng.random() < 0.6)
    m = (1e-3 if both else 0.0, 1e-3)
    where = ("face:front", "face:back", f"interface:disk|{s.coats[0].name}" if s.coats else "face:front", "layer:disk")
    return slot_plant(
        "electrode-mass", where, s.steps, lambda k: {"mass": (k * m[0], k * m[1])}, {"mass": 1e-3}, most=60.0
    )


def dot(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant a solder dot or a wire on part of a face."""
    side, share = _side(rng), float(rng.uniform(0.005, 0.05))
    steps = s.steps if side == "back" else s.steps[-1:]
    where = _faces(s, side, s.steps)
    return slot_plant(
        "local-mass",
        where,
        steps,
        lambda k: {"dot": (share, k * 0.1, side)},
        {"mass": 0.1, "fraction": share},
        most=12.0,
    )


def bond(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant a glue layer that the build file does not have."""
    k = int(rng.integers(0, len(s.coats) // 2))
    glue, behind, before = s.coats[2 * k], "disk" if k == 0 else s.coats[2 * k - 1].name, s.coats[2 * k + 1].name
    t = 1e-5

    def put(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, untold=(glue.name, scale * t))

    where = (f"interface:{behind}|{before}",)
    return InjectedEffect(
        "bond-layer", where, s.steps[k + 1 :], put, {"thickness": t}, least=0.05, most=3.0, needs="a bond"
    )


def void(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant nothing bonded on part of the area."""
    k = int(rng.integers(0, len(s.coats) // 2))
    glue, behind, before = s.coats[2 * k].name, "disk" if k == 0 else s.coats[2 * k - 1].name, s.coats[2 * k + 1].name
    where = (f"interface:{behind}|{glue}", f"interface:{glue}|{before}", f"layer:{glue}")
    return slot_plant(
        "bond-void",
        where,
        s.steps[k + 1 :],
        lambda n: {"void": (behind, 0.02 * n)},
        {"fraction": 0.02},
        most=15.0,
        needs="a bond",
    )


def taper(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant faces that are not parallel."""
    layer = "ml1" if s.coats and rng.random() < 0.25 else "disk"
    steps = s.steps if layer == "disk" else s.steps[1:]
    shape = str(rng.choice(["wedge", "round wedge", "dome", "rough"]))
    base, most = (2e-3, 8.0) if layer == "disk" else (2e-2, 8.0)
    return slot_plant(
        "thickness-variation",
        (f"layer:{layer}",),
        steps,
        lambda k: {"taper": (layer, base * k, shape)},
        {"half_range": base},
        most=most,
    )


def surface(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant no piezoelectricity under a face, or less."""
    side, kind = _side(rng), "dead" if rng.random() < 0.6 else "graded"
    where = ("layer:disk", "face:back", "face:front")
    return slot_plant(
        "surface-layer",
        where,
        s.steps,
        lambda k: {"surface": (2e-6 * k, side, kind)},
        {"depth": 2e-6},
        most=12.0,
    )


def modes(_: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant a disk that is as wide as it is."""
    return slot_plant(
        "lateral-modes",
        ("layer:disk",),
        s.steps,
        lambda _: {"modes": True},
        {"aspect": s.diameter},
        least=1.0,
        most=1.0,
        needs="the disk alone",
    )


def loss(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant a loss that follows a power of frequency."""
    causal = bool(rng.random() < 0.3)
    layer = "ml1" if s.coats and rng.random() < 0.2 else "disk"
    sign = 1.0 if causal or rng.random() < 0.6 else -1.0
    steps = s.steps if layer == "disk" else s.steps[1:]
    return slot_plant(
        "loss-dispersion",
        (f"layer:{layer}",),
        steps,
        lambda k: {"loss_power": (layer, sign * k, causal)},
        {"exponent": sign},
        least=0.4 if causal else 1e-3,
        most=1.2,
    )


def dielectric(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant a permittivity that falls with frequency."""
    kind = "power" if rng.random() < 0.6 else "relaxation"
    return slot_plant(
        "dielectric-dispersion",
        ("layer:disk",),
        s.steps,
        lambda k: {"dielectric": (kind, 0.01 * k)},
        {"exponent" if kind == "power" else "strength": 0.01},
        most=3.0,
    )


def face(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant something soft, springy or wet that a face rests on."""
    side = _side(rng)
    kind, size, most = [("resistive", 1e5, 5.0), ("spring", 1e12, 5.0), ("fluid", 1.5e6, 1.1)][int(rng.integers(0, 3))]
    first = s.steps if side == "back" else s.steps[-1:]
    return slot_plant(
        "face-load",
        _faces(s, side, s.steps),
        first,
        lambda k: {"face": (side, kind, size * k)},
        {kind: size},
        least=0.7 if kind == "fluid" else 1e-3,
        most=most,
    )


def backing(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Plant a backing from whose rear echoes come back."""
    waves = float(rng.uniform(3, 15))

    def slot(echo: float) -> dict[str, Any]:
        return {"backing": (waves, 4 * np.pi * waves / -np.log(echo))}

    where = ("face:back",)
    sizes = {"echo": 1.0}
    return slot_plant(
        "finite-backing", where, s.steps, slot, sizes, least=1e-4, most=0.3, scale=0.05, needs="a backing"
    )
