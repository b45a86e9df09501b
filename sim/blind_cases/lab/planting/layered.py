"""Families of effects on the faces, in the bonds and in the layers, with sizes that occur in laboratories."""

from dataclasses import replace

import numpy as np

from ..devices.flaws import Side
from ..devices.specimen import AIR, LabDevice
from ..distributions import Random, lognormal, loguniform
from .plant import LabWorld, Plant


def _side(rng: Random) -> Side:
    return "back" if rng.random() < 0.5 else "front"


def _faces(specimen: LabDevice, side: Side, steps: tuple[str, ...]) -> tuple[str, ...]:
    """Return the faces that count as right: a bare disk between equal loads looks the same from both sides."""
    return ("face:back", "face:front") if steps == ("disk",) and specimen.back == AIR else (f"face:{side}",)


def mass(rng: Random, s: LabDevice) -> Plant:
    """Plant electrodes of silver paste; the constants mostly absorb them."""
    m, both = lognormal(rng, 0.02, 0.5), bool(rng.random() < 0.6)

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(electrodes=(m * k if both else 0.0, m * k))

    where = (
        "face:front",
        "face:back",
        f"interface:disk|{s.layers[0].name}" if s.layers else "face:front",
        "layer:disk",
    )
    return Plant("electrode-mass", where, s.steps, put, {"mass": m}, {"faces": 2.0 if both else 1.0}, most=4.0)


def dot(rng: Random, s: LabDevice) -> Plant:
    """Plant solder on part of a face."""
    side, share, m = _side(rng), float(rng.uniform(0.005, 0.05)), lognormal(rng, 0.4, 0.6)
    steps = s.steps if side == "back" else s.steps[-1:]

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(dot=(min(share * k**0.5, 0.2), m * k**0.5, side))

    return Plant("local-mass", _faces(s, side, s.steps), steps, put, {}, {"mass": m, "fraction": share}, most=9.0)


def _bond(rng: Random, s: LabDevice) -> tuple[int, str, str, str]:
    k = int(rng.integers(0, len(s.layers) // 2))
    behind = "disk" if k == 0 else s.layers[2 * k - 1].name
    return k, behind, s.layers[2 * k].name, s.layers[2 * k + 1].name


def bond(rng: Random, s: LabDevice) -> Plant:
    """Plant a glue, softer and lossier than the library's, that the build file omits."""
    k, behind, glue, before = _bond(rng, s)
    t = lognormal(rng, 1e-5, 0.5)

    def put(world: LabWorld, scale: float) -> LabWorld:
        soft = tuple(
            replace(one, z=one.z * 0.85, c=one.c * 0.85, q=min(one.q, 14.0)) if one.name == glue else one
            for one in world.specimen.layers
        )
        world = replace(world, specimen=replace(world.specimen, layers=soft))
        return world.with_flaws(untold=(glue, t * scale))

    where = (f"interface:{behind}|{before}",)
    return Plant("bond-layer", where, s.steps[k + 1 :], put, {"thickness": t}, least=0.2, most=2.5, needs="a bond")


def void(rng: Random, s: LabDevice) -> Plant:
    """Plant a bond with a void on part of its area and a half-bonded rim around it."""
    k, behind, glue, before = _bond(rng, s)
    share, rim = lognormal(rng, 0.05, 0.8), float(rng.uniform(0.2, 0.8))

    def put(world: LabWorld, scale: float) -> LabWorld:
        return world.with_flaws(void=(behind, min(share * scale, 0.5), rim))

    where = (
        f"interface:{behind}|{glue}",
        f"interface:{glue}|{before}",
        f"layer:{glue}",
        f"interface:{behind}|{before}",
    )
    return Plant("bond-void", where, s.steps[k + 1 :], put, {"fraction": share}, {"rim": rim}, needs="a bond")


def spread(rng: Random, s: LabDevice) -> Plant:
    """Plant faces that are not parallel: a smooth distribution of thickness."""
    layer = "ml1" if s.layers and rng.random() < 0.2 else "disk"
    sigma = lognormal(rng, 4e-3 if layer == "disk" else 3e-2, 0.6)
    shape = str(rng.choice(["gauss", "triangle", "skew"]))
    steps = s.steps if layer == "disk" else s.steps[1:]

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(spread=(*world.flaws.spread, (layer, min(sigma * k, 0.06), shape)))

    return Plant("thickness-variation", (f"layer:{layer}",), steps, put, {"sigma": sigma}, {"shape": shape}, most=5.0)


def surface(rng: Random, s: LabDevice) -> Plant:
    """Plant a layer under a face without coupling, of unpoled stiffness and permittivity, that ends gradually."""
    side, depth = _side(rng), s.ceramic.thickness * lognormal(rng, 0.012, 0.6)
    stiff, less = float(rng.uniform(0.78, 0.95)), float(rng.uniform(0.8, 1.25))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(surface=(min(depth * k, 0.1 * s.ceramic.thickness), side, stiff, less))

    where = ("layer:disk", "face:back", "face:front")
    shape = {"stiffness": stiff, "permittivity": less}
    return Plant("surface-layer", where, s.steps, put, {"thickness": depth}, shape, most=6.0)


def lateral(rng: Random, s: LabDevice) -> Plant:
    """Plant a disk of finite diameter, with its own tensor of constants."""
    nominal = (147e9, 105e9, 93.7e9, 23.0e9, -3.09, 11.64, 1130.0)
    lateral = tuple(value * float(rng.uniform(0.95, 1.05)) for value in nominal)

    def put(world: LabWorld, _: float) -> LabWorld:
        return world.with_flaws(lateral=lateral)

    return Plant("lateral-modes", ("layer:disk",), s.steps, put, least=1.0, most=1.0, needs="a plain disk")


def loss(rng: Random, s: LabDevice) -> Plant:
    """Plant a part of the loss that grows with frequency, or one that falls."""
    layer = "ml1" if s.layers and rng.random() < 0.15 else "disk"
    grows = bool(rng.random() < 0.75)
    part, power = (
        float(rng.uniform(0.3, 0.9)),
        float(rng.uniform(0.8, 2.0)) if grows else float(rng.uniform(-1.5, -0.7)),
    )
    steps = s.steps if layer == "disk" else s.steps[1:]

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(viscosity=(layer, min(part * k, 1.0), power))

    return Plant("loss-dispersion", (f"layer:{layer}",), steps, put, {"part": part}, {"power": power}, most=1.0 / part)


def dielectric(rng: Random, s: LabDevice) -> Plant:
    """Plant a relaxation of Havriliak and Negami, or of Cole and Cole."""
    size, at = lognormal(rng, 0.04, 0.6), loguniform(rng, 0.15, 3.0)
    alpha, beta = float(rng.uniform(0.5, 0.9)), float(rng.choice([1.0, 0.7]))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(relaxation=(size * k, at, alpha, beta))

    shape = {"at": at, "alpha": alpha, "beta": beta}
    return Plant("dielectric-dispersion", ("layer:disk",), s.steps, put, {"strength": size}, shape, most=6.0)


def piezoelectric(rng: Random, s: LabDevice) -> Plant:
    """Plant a relaxation of h33, of Havriliak and Negami, or of Cole and Cole."""
    size, at = lognormal(rng, 0.02, 0.6) * (1 if rng.random() < 0.5 else -1), loguniform(rng, 0.3, 3.0)
    alpha, beta = float(rng.uniform(0.5, 0.9)), float(rng.choice([1.0, 0.7]))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(piezo=(size * k, at, alpha, beta))

    shape = {"at": at, "alpha": alpha, "beta": beta}
    return Plant("piezoelectric-dispersion", ("layer:disk",), s.steps, put, {"strength": size}, shape, most=6.0)


def face(rng: Random, s: LabDevice) -> Plant:
    """Plant a pad that a face rests on, or a liquid in front of it."""
    kind = "fluid" if rng.random() < 0.4 else "pad"
    size = float(rng.uniform(1.1e6, 1.8e6)) if kind == "fluid" else lognormal(rng, 1e5, 0.8)
    return _resting(rng, s, "face-load", kind, size, float(rng.uniform(0.0, 1.0)))


def viscous(rng: Random, s: LabDevice) -> Plant:
    """Plant a viscous liquid that a face drags along, half relaxed at high frequency."""
    return _resting(rng, s, "viscous-load", "viscous", lognormal(rng, 8e4, 0.7), float(rng.uniform(0.0, 0.15)))


def _resting(rng: Random, s: LabDevice, effect: str, kind: str, size: float, shape: float) -> Plant:
    side = _side(rng)
    steps = s.steps if side == "back" else s.steps[-1:]

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(face=(side, kind, size * k, shape))

    least, most = (0.8, 1.2) if kind == "fluid" else (0.05, 8.0)
    where = _faces(s, side, s.steps)
    return Plant(effect, where, steps, put, {"Rayl": size}, {"kind": kind, "shape": shape}, least=least, most=most)


def backing(rng: Random, s: LabDevice) -> Plant:
    """Plant a backing from whose rear echoes come back, its loss growing with frequency."""
    waves, power = float(rng.uniform(3, 15)), float(rng.uniform(0.0, 0.6))
    echo = min(lognormal(rng, 0.06, 0.8), 0.5)

    def put(world: LabWorld, k: float) -> LabWorld:
        q = 2 * np.pi * waves / -np.log(min(echo * k, 0.7))
        return world.with_flaws(backing=(waves, q, power))

    shape = {"waves": waves, "power": power}
    return Plant("finite-backing", ("face:back",), s.steps, put, {"echo": echo}, shape, most=6.0, needs="a backing")


def resonance(rng: Random, s: LabDevice) -> Plant:
    """Plant one further resonance: in parallel with the ceramic, or within its stiffness."""
    f, Q = s.ceramic.f0 * float(rng.uniform(0.6, 1.3)), float(rng.uniform(30, 200))
    how, size = ("beside" if rng.random() < 0.5 else "within"), lognormal(rng, 1e-3, 0.7)

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(modes=(*world.flaws.modes, (f, Q, size * k, how)))

    return Plant("spurious-resonance", anywhere(s), s.steps, put, {"strength": size}, {"f": f, "Q": Q, "how": how})


def anywhere(s: LabDevice) -> tuple[str, ...]:
    """Return all accepted places of a resonance whose place cannot be determined."""
    return (
        "layer:disk",
        *(f"layer:{c.name}" for c in s.layers),
        *(f"interface:{c.name}|" for c in s.layers),
        "interface:disk|",
    )


def ageing(rng: Random, s: LabDevice) -> Plant:
    """Plant constants that differ from the first step to the later ones: depoled by the heat of curing, or aged."""
    size = lognormal(rng, 5e-3, 0.6)
    c, h, eps = size * float(rng.uniform(0.1, 0.6)), -size, size * float(rng.uniform(0.5, 2.5))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(ageing=(c * k, h * k, eps * k))

    sizes = {"c33D": c, "h33": h, "eps33S": eps}
    return Plant("ageing", ("layer:disk",), s.steps[1:], put, sizes, most=4.0, needs="a bond")
