"""The families that plants are drawn from: at the terminals, on the faces, in the layers, in the sweep."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from .circuit import Path
from .hidden import Hidden, Side
from .plant import Plant
from .specimen import AIR, Specimen

Family = Callable[[np.random.Generator, Specimen], Plant]


def path_plant(effect: str, steps: tuple[str, ...], most: float, **sizes: Any) -> Plant:
    """Return a plant on the way to the device; the sizes are those of `Path`."""

    def put(hidden: Hidden, scale: float) -> Hidden:
        path: Path = replace(hidden.path, **{name: scale * size for name, size in sizes.items()})
        return replace(hidden, path=path)

    return Plant(effect, ("terminals",), steps, put, sizes, most=most)


def slot_plant(
    effect: str,
    where: tuple[str, ...],
    steps: tuple[str, ...],
    slot: Callable[[float], dict[str, Any]],
    sizes: dict[str, float],
    **more: Any,
) -> Plant:
    """Return a plant that fills fields of `Hidden`; at scale 0 they are left as they are."""

    def put(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, **slot(scale)) if scale else hidden

    return Plant(effect, where, steps, put, sizes, **more)


def some_steps(rng: np.random.Generator, specimen: Specimen) -> tuple[str, ...]:
    """Return all steps, or sometimes those from a later one on: another clip."""
    first = int(rng.integers(0, len(specimen.steps))) if rng.random() < 0.3 else 0
    return specimen.steps[first:]


def _side(rng: np.random.Generator) -> Side:
    return "back" if rng.random() < 0.5 else "front"


def _faces(specimen: Specimen, side: Side, steps: tuple[str, ...]) -> tuple[str, ...]:
    """Return the faces that count as right: a bare disk between equal loads looks the same from both sides."""
    alone = steps == ("disk",) and specimen.back == AIR
    return ("face:back", "face:front") if alone else (f"face:{side}",)


def _lead(rng: np.random.Generator, s: Specimen) -> Plant:
    return path_plant("lead-inductance", some_steps(rng, s), 30.0, inductance=1e-8)


def _resistance(rng: np.random.Generator, s: Specimen) -> Plant:
    return path_plant("series-resistance", some_steps(rng, s), 30.0, resistance=0.1)


def _stray(rng: np.random.Generator, s: Specimen) -> Plant:
    return path_plant("stray-capacitance", some_steps(rng, s), 20.0, capacitance=3e-12)


def _leakage(rng: np.random.Generator, s: Specimen) -> Plant:
    return path_plant("leakage", some_steps(rng, s), 100.0, conductance=1e-5)


def _cable(rng: np.random.Generator, s: Specimen) -> Plant:
    return replace(path_plant("cable", some_steps(rng, s), 12.0, delay=5e-10), least=0.2)


def _polarity(rng: np.random.Generator, s: Specimen) -> Plant:
    how = "conjugated" if rng.random() < 0.5 else "inverted"
    return slot_plant("polarity", ("terminals",), s.steps, lambda _: {"recorded": how}, {}, least=1.0, most=1.0)


def mass(rng: np.random.Generator, s: Specimen) -> Plant:
    """Electrodes of some mass: on one face or on both."""
    both = bool(rng.random() < 0.6)
    m = (1e-3 if both else 0.0, 1e-3)
    where = ("face:front", "face:back", f"interface:disk|{s.coats[0].name}" if s.coats else "face:front", "layer:disk")
    return slot_plant(
        "electrode-mass", where, s.steps, lambda k: {"mass": (k * m[0], k * m[1])}, {"mass": 1e-3}, most=60.0
    )


def _dot(rng: np.random.Generator, s: Specimen) -> Plant:
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


def _bond(rng: np.random.Generator, s: Specimen) -> Plant:
    k = int(rng.integers(0, len(s.coats) // 2))
    glue, behind, before = s.coats[2 * k], "disk" if k == 0 else s.coats[2 * k - 1].name, s.coats[2 * k + 1].name
    t = 1e-5

    def put(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, untold=(glue.name, scale * t))

    where = (f"interface:{behind}|{before}",)
    return Plant("bond-layer", where, s.steps[k + 1 :], put, {"thickness": t}, least=0.05, most=3.0, needs="a bond")


def _void(rng: np.random.Generator, s: Specimen) -> Plant:
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


def _taper(rng: np.random.Generator, s: Specimen) -> Plant:
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


def _surface(rng: np.random.Generator, s: Specimen) -> Plant:
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


def _modes(_: np.random.Generator, s: Specimen) -> Plant:
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


def _loss(rng: np.random.Generator, s: Specimen) -> Plant:
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
        least=0.4 if causal else 0.01,
        most=1.2,
    )


def _dielectric(rng: np.random.Generator, s: Specimen) -> Plant:
    kind = "power" if rng.random() < 0.6 else "relaxation"
    return slot_plant(
        "dielectric-dispersion",
        ("layer:disk",),
        s.steps,
        lambda k: {"dielectric": (kind, 0.01 * k)},
        {"exponent" if kind == "power" else "strength": 0.01},
        most=3.0,
    )


def face(rng: np.random.Generator, s: Specimen) -> Plant:
    """Something soft, springy or wet that a face rests on."""
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


def _backing(rng: np.random.Generator, s: Specimen) -> Plant:
    waves = float(rng.uniform(3, 15))

    def slot(echo: float) -> dict[str, Any]:
        return {"backing": (waves, 4 * np.pi * waves / -np.log(echo))}

    where = ("face:back",)
    sizes = {"echo": 1.0}
    return slot_plant(
        "finite-backing", where, s.steps, slot, sizes, least=1e-4, most=0.3, scale=0.05, needs="a backing"
    )


def _resonance(rng: np.random.Generator, s: Specimen) -> Plant:
    f, Q = s.disk.f0 * float(rng.uniform(0.6, 1.3)), float(rng.uniform(30, 150))
    C = s.disk.eps33S.real * s.area / s.disk.thickness * 1e-3
    where = ("layer:disk", *(f"layer:{c.name}" for c in s.coats), *(f"interface:{c.name}|" for c in s.coats))

    def put(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, path=replace(hidden.path, branch=(f, Q, C * scale) if scale else None))

    return Plant("spurious-resonance", where, s.steps, put, {"f": f, "Q": Q, "strength": 1e-3}, most=10.0)


def _drift(rng: np.random.Generator, s: Specimen) -> Plant:
    c = -1e-4 * (1 if rng.random() < 0.7 else -1)
    eps = -c * float(rng.uniform(0, 30))
    return slot_plant(
        "temperature-drift",
        ("sweep",),
        ("disk",),
        lambda k: {"drift": (c * k, eps * k)},
        {"stiffness": c, "permittivity": eps},
        most=30.0,
        needs="up and down",
    )


def _softening(_: np.random.Generator, s: Specimen) -> Plant:
    return slot_plant(
        "drive-nonlinearity",
        ("layer:disk",),
        s.steps,
        lambda k: {"softening": 100.0 * k},
        {"per_strain": 100.0},
        most=50.0,
        needs="levels",
    )


def _settling(_: np.random.Generator, s: Specimen) -> Plant:
    return slot_plant(
        "sweep-lag",
        ("sweep",),
        s.steps,
        lambda k: {"settling": 1e-3 * k},
        {"time_constant": 1e-3},
        most=300.0,
        needs="up and down",
    )


CATALOGUE: tuple[tuple[float, Family], ...] = (
    *((1.5, _lead), (1.0, _resistance), (1.0, _stray), (0.7, _leakage), (1.0, _cable), (0.4, _polarity)),
    *((1.0, _dot), (1.3, _bond), (1.3, _void), (1.5, _taper), (1.0, _surface), (1.0, _modes)),
    *((1.0, _loss), (1.0, _dielectric), (1.0, face), (0.8, _backing), (1.0, _resonance)),
    *((1.0, _drift), (1.0, _softening), (0.8, _settling)),
)
"""Weight and family of everything that DESIGN's table names, electrode masses apart: those hide."""

BOND: tuple[Family, ...] = (_bond, _void)
"""Families that need something glued on."""


def outside(rng: np.random.Generator, s: Specimen) -> Plant:
    """Return a flaw that no catalogue has."""
    kinds = ("range step", "gain ripple", "phase error", "glitch", "coupled")
    kind, at = str(rng.choice(kinds)), float(rng.uniform(0.2, 0.8))
    where = ("any",)
    if kind != "coupled":
        return slot_plant(
            "unknown", where, s.steps, lambda k: {"outside": (kind, 1e-3 * k, at)}, {kind: 1e-3}, most=30.0
        )
    f, Q = s.disk.f0 * float(rng.uniform(0.5, 1.4)), float(rng.uniform(3, 12))

    def put(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, path=replace(hidden.path, coupled=(f, Q, 1e-10 * scale) if scale else None))

    return Plant("unknown", where, s.steps, put, {"coupled": 1e-10}, most=100.0, accept=("spurious-resonance",))
