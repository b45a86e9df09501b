"""Families of effects in the wiring and in the sweep, with sizes that occur in laboratories."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ..devices.specimen import LabDevice
from ..distributions import Random, lognormal
from .plant import LabWorld, Plant

_NEIGHBOUR = ("spurious-resonance", "thickness-variation", "local-mass")
"""Accepted names of a second ceramic of another thickness."""


def some_steps(rng: Random, specimen: LabDevice) -> tuple[str, ...]:
    """Return all steps, or sometimes only those from a later one on, as if the clip had been changed."""
    first = int(rng.integers(0, len(specimen.steps))) if rng.random() < 0.3 else 0
    return specimen.steps[first:]


def lead(rng: Random, s: LabDevice) -> Plant:
    """Plant a wire: inductance, skin effect, a little capacitance of its own."""
    L, skin, C = lognormal(rng, 25e-9, 0.9), float(rng.uniform(0.005, 0.04)), float(rng.uniform(0.05e-12, 0.4e-12))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.wired(inductance=L * k, skin=skin * k**0.5, winding=C)

    return Plant("lead-inductance", ("terminals",), some_steps(rng, s), put, {"inductance": L}, {"skin": skin})


def resistance(rng: Random, s: LabDevice) -> Plant:
    """Plant a contact whose resistance grows a little with frequency."""
    R, power = lognormal(rng, 0.5, 1.0), float(rng.uniform(0.0, 0.3))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.wired(resistance=R * k, resistance_power=power)

    return Plant("series-resistance", ("terminals",), some_steps(rng, s), put, {"resistance": R}, {"power": power})


def stray(rng: Random, s: LabDevice) -> Plant:
    """Plant a parallel capacitance of lossy plastic."""
    C, tan = min(lognormal(rng, 6e-12, 1.0), 0.3 * s.C0), float(rng.uniform(0.002, 0.03))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.wired(capacitance=C * k, capacitance_tan=tan)

    return Plant("stray-capacitance", ("terminals",), some_steps(rng, s), put, {"capacitance": C}, {"tan": tan})


def leakage(rng: Random, s: LabDevice) -> Plant:
    """Plant a conductance that grows slowly with frequency, as on moist surfaces."""
    G, power = 2 * np.pi * s.ceramic.f0 * s.C0 * lognormal(rng, 3e-3, 1.0), float(rng.uniform(0.0, 0.25))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.wired(conductance=G * k, conductance_power=power)

    return Plant("leakage", ("terminals",), some_steps(rng, s), put, {"conductance": G}, {"power": power})


def cable(rng: Random, s: LabDevice) -> Plant:
    """Plant a length of lossy cable."""
    delay, ohm = lognormal(rng, 2e-9, 0.6), float(rng.choice([50.0, 75.0, 50.0]))
    loss = delay * float(rng.uniform(0.5e6, 4e6))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.wired(delay=delay * k, cable_ohm=ohm, cable_loss=loss * k)

    return Plant("cable", ("terminals",), some_steps(rng, s), put, {"delay": delay}, {"ohm": ohm, "loss": loss})


def polarity(rng: Random, s: LabDevice) -> Plant:
    """Plant a recording with a wrong sign."""
    how = "conjugated" if rng.random() < 0.5 else "inverted"
    put = _flag(recorded=how)
    return Plant("polarity", ("terminals",), s.steps, put, shape={"how": how}, least=1.0, most=1.0)


def _flag(**changes: object):
    def put(world: LabWorld, _: float) -> LabWorld:
        return world.with_flaws(**changes)

    return put


def sheet(rng: Random, s: LabDevice) -> Plant:
    """Plant a thin electrode that is contacted at a dot."""
    ohm, radius = lognormal(rng, 0.4, 1.0), float(rng.uniform(0.05, 0.2))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(sheet=(ohm * k, radius))

    where = ("face:front", "face:back", "terminals", "layer:disk")
    return Plant("electrode-sheet", where, s.steps, put, {"ohm_per_square": ohm}, {"radius": radius})


def drift(rng: Random, s: LabDevice) -> Plant:
    """Plant a device that warms up or cools while it is swept, exponentially."""
    c = -lognormal(rng, 4e-4, 0.7) * (1 if rng.random() < 0.7 else -1)
    eps, time = -c * float(rng.uniform(3, 15)), float(rng.uniform(0.4, 2.0))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(drift=(c * k, eps * k, time))

    sizes = {"stiffness": c, "permittivity": eps, "relative": c / 2}
    return Plant("temperature-drift", ("sweep",), ("disk",), put, sizes, {"time": time}, needs="up and down")


def softening(rng: Random, s: LabDevice) -> Plant:
    """Plant a stiffness that falls with the strain, not quite in proportion, and loses energy doing so."""
    size, lost, power = lognormal(rng, 6e-3, 0.7), float(rng.uniform(0.2, 1.0)), float(rng.uniform(0.75, 1.3))

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(softening=(size * k, lost, power))

    shape = {"loss": lost, "power": power}
    return Plant("drive-nonlinearity", ("layer:disk",), s.steps, put, {"at 1e-5": size}, shape, needs="levels")


def settling(rng: Random, s: LabDevice) -> Plant:
    """Plant a detector that is too slow for the sweep."""
    seconds = lognormal(rng, 8e-3, 0.8)

    def put(world: LabWorld, k: float) -> LabWorld:
        return world.with_flaws(settling=seconds * k)

    return Plant("sweep-lag", ("sweep",), s.steps, put, {"time_constant": seconds}, most=50.0, needs="up and down")


def outside(rng: Random, s: LabDevice) -> Plant:
    """Plant an effect that no catalogue has."""
    at, w0C0 = float(rng.uniform(0.25, 0.8)), 2 * np.pi * s.ceramic.f0 * s.C0
    loop, ratio = (s.ceramic.f0 * float(rng.uniform(0.5, 1.5)), float(rng.uniform(3, 12))), float(rng.uniform(0.7, 0.9))
    kinds: dict[str, tuple[float, Callable[[LabWorld, float], LabWorld], tuple[str, ...]]] = {
        "dry contact": (0.02 / w0C0, lambda w, k: w.wired(contact=k), ("series-resistance",)),
        "humid film": (0.02 * w0C0, lambda w, k: w.wired(film=k), ("leakage", "stray-capacitance")),
        "coupled loop": (2e-9, lambda w, k: replace(w, flaws=w.flaws.looped((*loop, k))), ("spurious-resonance",)),
        "anelastic relaxation": (0.02, lambda w, k: w.with_flaws(anelastic=(k, 2 * at)), ("loss-dispersion",)),
        "neighbour": (0.03, lambda w, k: w.with_flaws(neighbour=(ratio, k)), _NEIGHBOUR),
        "interference": (0.02, lambda w, k: w.with_flaws(recording=("interference", k, at)), ()),
        "loose contact": (0.02, lambda w, k: w.with_flaws(recording=("loose contact", k, at)), ()),
        "mixing": (0.02, lambda w, k: w.with_flaws(recording=("mixing", k, at)), ()),
    }
    kind = str(rng.choice(list(kinds)))
    median, put, accept = kinds[kind]
    size = lognormal(rng, median, 0.6)
    return Plant(
        "unknown", ("any",), s.steps, lambda w, k: put(w, size * k), {"size": size}, {"kind": kind}, accept=accept
    )
