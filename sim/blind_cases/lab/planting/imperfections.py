"""Imperfections of every real device: scatter of thickness, dispersion of loss and permittivity, weak resonances."""

from dataclasses import replace

import numpy as np

from ..devices.specimen import LabDevice
from ..distributions import Random, lognormal
from .layered import anywhere
from .plant import LabWorld, Plant

_USUAL_POWER = 0.2
"""Exponent of a loss over frequency that devices have, of either sign."""


def imperfections(rng: Random, s: LabDevice) -> tuple[Plant, ...]:
    """Return a device's imperfections: scatter of thickness, dispersion of loss and permittivity, weak resonances."""
    found = [_minor(spread_of(float(rng.uniform(2e-4, 8e-4)), s))]
    kind = s.ceramic.kind
    power = float(rng.uniform(0.0, 0.5) if kind == "composite" else rng.uniform(-0.25, 0.35))
    causal = kind in ("film", "composite") or bool(rng.random() < 0.15)
    most = 2 / np.pi * abs(s.ceramic.eps33S.imag / s.ceramic.eps33S.real)
    slope = most * float(rng.uniform(0.3, 1.0)) if kind == "film" else min(lognormal(rng, 1.5e-3, 0.5), most)

    def dispersed(world: LabWorld, k: float) -> LabWorld:
        return world.with_ceramic(loss_power=power * k, causal=causal)

    def falling(world: LabWorld, k: float) -> LabWorld:
        return world.with_ceramic(slope=slope * k)

    shape = {"causal": float(causal)}
    found.append(_minor(Plant("loss-dispersion", ("layer:disk",), s.steps, dispersed, {"power": power}, shape)))
    if s.layers:
        found.append(_minor(_coats_dispersed(rng, s)))
    found.append(_minor(Plant("dielectric-dispersion", ("layer:disk",), s.steps, falling, {"slope": slope})))
    found += [_minor(_weak(rng, s)) for _ in range(int(rng.integers(1, 4)))]
    return tuple(found)


def _coats_dispersed(rng: Random, s: LabDevice) -> Plant:
    """Return losses of the glued layers that follow a power of frequency."""
    power, causal = float(rng.uniform(-0.2, 0.4)), bool(rng.random() < 0.15)

    def put(world: LabWorld, k: float) -> LabWorld:
        layers = tuple(replace(one, loss_power=power * k, causal=causal) for one in world.specimen.layers)
        return replace(world, specimen=replace(world.specimen, layers=layers))

    where = tuple(f"layer:{layer.name}" for layer in s.layers)
    return Plant("loss-dispersion", where, s.steps[1:], put, {"power": power}, {"causal": float(causal)})


def spread_of(sigma: float, s: LabDevice) -> Plant:
    """Return a scatter of the ceramic's thickness."""

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(spread=(*world.flaws.spread, ("disk", sigma * k, "gauss")))

    return Plant("thickness-variation", ("layer:disk",), s.steps, put, {"sigma": sigma})


def _weak(rng: Random, s: LabDevice) -> Plant:
    f, Q, size = s.ceramic.f0 * float(rng.uniform(0.3, 2.0)), float(rng.uniform(20, 100)), lognormal(rng, 4e-5, 0.7)

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(modes=(*world.flaws.modes, (f, Q, size * k, "beside")))

    return Plant("spurious-resonance", anywhere(s), s.steps, put, {"strength": size}, {"f": f, "Q": Q})


def _minor(plant: Plant) -> Plant:
    power = abs(plant.sizes.get("power", _USUAL_POWER))
    return replace(plant, minor=True, usual=_USUAL_POWER / max(power, 1e-3 * _USUAL_POWER))
