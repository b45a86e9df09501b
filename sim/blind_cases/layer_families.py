"""Families of effects on the faces, in the bonds and in the layers."""

from dataclasses import replace
from typing import Any

import numpy as np

from .device_under_test import AIR, DeviceUnderTest
from .injected_effect import InjectedEffect, field_effect
from .scenario import Hidden, Side


def _side(rng: np.random.Generator) -> Side:
    return "back" if rng.random() < 0.5 else "front"


def _faces(device: DeviceUnderTest, side: Side, steps: tuple[str, ...]) -> tuple[str, ...]:
    """Return the faces accepted as correct: a bare disk between equal loads looks the same from both sides."""
    alone = steps == ("disk",) and device.back == AIR
    return ("face:back", "face:front") if alone else (f"face:{side}",)


def _behind(device: DeviceUnderTest, bond: int) -> str:
    """Return the name of the layer behind the glue of bond number `bond`, counted from 0."""
    return "disk" if bond == 0 else device.layers[2 * bond - 1].name


def mass(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return electrodes that have a mass, on one face or on both."""
    both = bool(rng.random() < 0.6)
    m = (1e-3 if both else 0.0, 1e-3)
    where = (
        "face:front",
        "face:back",
        f"interface:disk|{s.layers[0].name}" if s.layers else "face:front",
        "layer:disk",
    )
    return field_effect(
        "electrode-mass", where, s.steps, lambda k: {"mass": (k * m[0], k * m[1])}, {"mass": 1e-3}, max_scale=60.0
    )


def dot(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a solder dot or a wire on part of a face."""
    side, share = _side(rng), float(rng.uniform(0.005, 0.05))
    steps = s.steps if side == "back" else s.steps[-1:]
    where = _faces(s, side, s.steps)
    return field_effect(
        "local-mass",
        where,
        steps,
        lambda k: {"dot": (share, k * 0.1, side)},
        {"mass": 0.1, "fraction": share},
        max_scale=12.0,
    )


def bond(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a glue layer that the build file omits."""
    k = int(rng.integers(0, len(s.layers) // 2))
    glue, behind, before = s.layers[2 * k], _behind(s, k), s.layers[2 * k + 1].name
    t = 1e-5

    def apply(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, omitted=(glue.name, scale * t))

    where = (f"interface:{behind}|{before}",)
    return InjectedEffect(
        "bond-layer", where, s.steps[k + 1 :], apply, {"thickness": t}, min_scale=0.05, max_scale=3.0, needs="a bond"
    )


def void(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a bond with a void on part of its area."""
    k = int(rng.integers(0, len(s.layers) // 2))
    glue, behind, before = (
        s.layers[2 * k].name,
        "disk" if k == 0 else s.layers[2 * k - 1].name,
        s.layers[2 * k + 1].name,
    )
    where = (f"interface:{behind}|{glue}", f"interface:{glue}|{before}", f"layer:{glue}")
    return field_effect(
        "bond-void",
        where,
        s.steps[k + 1 :],
        lambda n: {"void": (behind, 0.02 * n)},
        {"fraction": 0.02},
        max_scale=15.0,
        needs="a bond",
    )


def taper(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a layer whose faces are not parallel."""
    layer = "ml1" if s.layers and rng.random() < 0.25 else "disk"
    steps = s.steps if layer == "disk" else s.steps[1:]
    shape = str(rng.choice(["wedge", "round wedge", "dome", "rough"]))
    base, max_scale = (2e-3, 8.0) if layer == "disk" else (2e-2, 8.0)
    return field_effect(
        "thickness-variation",
        (f"layer:{layer}",),
        steps,
        lambda k: {"taper": (layer, base * k, shape)},
        {"half_range": base},
        max_scale=max_scale,
    )


def surface(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a layer under a face with no or less piezoelectricity."""
    side, kind = _side(rng), "dead" if rng.random() < 0.6 else "graded"
    where = ("layer:disk", "face:back", "face:front")
    return field_effect(
        "surface-layer",
        where,
        s.steps,
        lambda k: {"surface": (2e-6 * k, side, kind)},
        {"depth": 2e-6},
        max_scale=12.0,
    )


def modes(_: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return the lateral modes of a disk of finite diameter."""
    return field_effect(
        "lateral-modes",
        ("layer:disk",),
        s.steps,
        lambda _: {"modes": True},
        {"aspect": s.diameter},
        min_scale=1.0,
        max_scale=1.0,
        needs="the disk alone",
    )


def loss(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a loss that follows a power of frequency."""
    causal = bool(rng.random() < 0.3)
    layer = "ml1" if s.layers and rng.random() < 0.2 else "disk"
    sign = 1.0 if causal or rng.random() < 0.6 else -1.0
    steps = s.steps if layer == "disk" else s.steps[1:]
    return field_effect(
        "loss-dispersion",
        (f"layer:{layer}",),
        steps,
        lambda k: {"loss_power": (layer, sign * k, causal)},
        {"exponent": sign},
        min_scale=0.4 if causal else 1e-3,
        max_scale=1.2,
    )


def dielectric(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a permittivity that falls with frequency."""
    kind = "power" if rng.random() < 0.6 else "relaxation"
    return field_effect(
        "dielectric-dispersion",
        ("layer:disk",),
        s.steps,
        lambda k: {"dielectric": (kind, 0.01 * k)},
        {"exponent" if kind == "power" else "strength": 0.01},
        max_scale=3.0,
    )


def face(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a resistive, springy or fluid load on a face."""
    side = _side(rng)
    kind, size, max_scale = [("resistive", 1e5, 5.0), ("spring", 1e12, 5.0), ("fluid", 1.5e6, 1.1)][
        int(rng.integers(0, 3))
    ]
    first = s.steps if side == "back" else s.steps[-1:]
    return field_effect(
        "face-load",
        _faces(s, side, s.steps),
        first,
        lambda k: {"face": (side, kind, size * k)},
        {kind: size},
        min_scale=0.7 if kind == "fluid" else 1e-3,
        max_scale=max_scale,
    )


def backing(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a backing with echoes from its rear face."""
    waves = float(rng.uniform(3, 15))

    def fields(echo: float) -> dict[str, Any]:
        return {"backing": (waves, 4 * np.pi * waves / -np.log(echo))}

    where = ("face:back",)
    sizes = {"echo": 1.0}
    return field_effect(
        "finite-backing", where, s.steps, fields, sizes, min_scale=1e-4, max_scale=0.3, scale=0.05, needs="a backing"
    )
