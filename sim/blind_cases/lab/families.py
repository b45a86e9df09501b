"""The families that effects are drawn from, on the way to the device and in the sweep; sizes as laboratories meet them."""

import numpy as np

from .plant import Plant, World
from .specimen import Specimen

Random = np.random.Generator


def lognormal(rng: Random, median: float, sd: float) -> float:
    """Draw a size whose logarithm is normal."""
    return float(np.exp(rng.normal(np.log(median), sd)))


def some_steps(rng: Random, specimen: Specimen) -> tuple[str, ...]:
    """Return all steps, or sometimes those from a later one on: another clip."""
    first = int(rng.integers(0, len(specimen.steps))) if rng.random() < 0.3 else 0
    return specimen.steps[first:]


def lead(rng: Random, s: Specimen) -> Plant:
    """Plant a wire: inductance, skin effect, a little capacitance of its own."""
    L, skin, C = lognormal(rng, 25e-9, 0.9), float(rng.uniform(0.005, 0.04)), float(rng.uniform(0.05e-12, 0.4e-12))

    def put(world: World, k: float) -> World:
        return world.wired(inductance=L * k, skin=skin * k**0.5, winding=C)

    return Plant("lead-inductance", ("terminals",), some_steps(rng, s), put, {"inductance": L}, {"skin": skin})


def resistance(rng: Random, s: Specimen) -> Plant:
    """Plant a contact whose resistance grows a little with frequency."""
    R, power = lognormal(rng, 0.5, 1.0), float(rng.uniform(0.0, 0.3))

    def put(world: World, k: float) -> World:
        return world.wired(resistance=R * k, resistance_power=power)

    return Plant("series-resistance", ("terminals",), some_steps(rng, s), put, {"resistance": R}, {"power": power})


def stray(rng: Random, s: Specimen) -> Plant:
    """Plant a capacitance beside the device, of lossy plastic."""
    C, tan = min(lognormal(rng, 6e-12, 1.0), 0.3 * s.C0), float(rng.uniform(0.002, 0.03))

    def put(world: World, k: float) -> World:
        return world.wired(capacitance=C * k, capacitance_tan=tan)

    return Plant("stray-capacitance", ("terminals",), some_steps(rng, s), put, {"capacitance": C}, {"tan": tan})


def leakage(rng: Random, s: Specimen) -> Plant:
    """Plant a conductance that grows slowly with frequency, as moist surfaces have it."""
    G, power = 2 * np.pi * s.ceramic.f0 * s.C0 * lognormal(rng, 3e-3, 1.0), float(rng.uniform(0.0, 0.25))

    def put(world: World, k: float) -> World:
        return world.wired(conductance=G * k, conductance_power=power)

    return Plant("leakage", ("terminals",), some_steps(rng, s), put, {"conductance": G}, {"power": power})


def cable(rng: Random, s: Specimen) -> Plant:
    """Plant a length of lossy cable."""
    delay, ohm = lognormal(rng, 2e-9, 0.6), float(rng.choice([50.0, 75.0, 50.0]))
    loss = delay * float(rng.uniform(0.5e6, 4e6))

    def put(world: World, k: float) -> World:
        return world.wired(delay=delay * k, cable_ohm=ohm, cable_loss=loss * k)

    return Plant("cable", ("terminals",), some_steps(rng, s), put, {"delay": delay}, {"ohm": ohm, "loss": loss})


def polarity(rng: Random, s: Specimen) -> Plant:
    """Plant a recording with a wrong sign."""
    how = "conjugated" if rng.random() < 0.5 else "inverted"
    put = _flag(recorded=how)
    return Plant("polarity", ("terminals",), s.steps, put, shape={"how": how}, least=1.0, most=1.0)


def _flag(**changes: object):  # noqa: ANN202 (a function of World and scale)
    def put(world: World, _: float) -> World:
        return world.with_flaws(**changes)

    return put


def sheet(rng: Random, s: Specimen) -> Plant:
    """Plant a thin electrode that is fed in a dot."""
    ohm, radius = lognormal(rng, 0.4, 1.0), float(rng.uniform(0.05, 0.2))

    def put(world: World, k: float) -> World:
        return world.with_flaws(sheet=(ohm * k, radius))

    where = ("face:front", "face:back", "terminals", "layer:disk")
    return Plant("electrode-sheet", where, s.steps, put, {"ohm_per_square": ohm}, {"radius": radius})


def drift(rng: Random, s: Specimen) -> Plant:
    """Plant a device that warms up or cools while it is swept, exponentially."""
    c = -lognormal(rng, 4e-4, 0.7) * (1 if rng.random() < 0.7 else -1)
    eps, time = -c * float(rng.uniform(3, 15)), float(rng.uniform(0.4, 2.0))

    def put(world: World, k: float) -> World:
        return world.with_flaws(drift=(c * k, eps * k, time))

    sizes = {"stiffness": c, "permittivity": eps}
    return Plant("temperature-drift", ("sweep",), ("disk",), put, sizes, {"time": time}, needs="up and down")


def softening(rng: Random, s: Specimen) -> Plant:
    """Plant a stiffness that falls with the strain, and loses energy doing so."""
    size, lost = lognormal(rng, 800.0, 0.7), float(rng.uniform(0.2, 1.0))

    def put(world: World, k: float) -> World:
        return world.with_flaws(softening=(size * k, lost))

    return Plant("drive-nonlinearity", ("layer:disk",), s.steps, put, {"per_strain": size}, {"loss": lost}, needs="levels")


def settling(rng: Random, s: Specimen) -> Plant:
    """Plant a detector that is slow for the pace of the sweep."""
    seconds = lognormal(rng, 8e-3, 0.8)

    def put(world: World, k: float) -> World:
        return world.with_flaws(settling=seconds * k)

    return Plant("sweep-lag", ("sweep",), s.steps, put, {"time_constant": seconds}, most=50.0, needs="up and down")


def outside(rng: Random, s: Specimen) -> Plant:
    """Plant something that no catalogue has."""
    kinds = ("dry contact", "humid film", "coupled loop", "piezo relaxation", "neighbour", "interference")
    kind = str(rng.choice((*kinds, "loose contact", "mixing")))
    accept: tuple[str, ...] = ()
    at = float(rng.uniform(0.25, 0.8))
    w0C0 = 2 * np.pi * s.ceramic.f0 * s.C0
    if kind == "dry contact":
        size = lognormal(rng, 0.02, 0.7) / w0C0
        accept = ("series-resistance",)
    elif kind == "humid film":
        size = lognormal(rng, 0.02, 0.7) * w0C0
        accept = ("leakage", "stray-capacitance")
    elif kind == "coupled loop":
        size = lognormal(rng, 2e-9, 0.7)
        accept = ("spurious-resonance",)
    elif kind == "neighbour":
        size = lognormal(rng, 0.03, 0.6)
        accept = ("spurious-resonance", "thickness-variation", "local-mass")
    else:
        size = lognormal(rng, 0.02, 0.6)
    loop_f, loop_Q, ratio = s.ceramic.f0 * float(rng.uniform(0.5, 1.5)), float(rng.uniform(3, 12)), float(rng.uniform(0.7, 0.9))

    def put(world: World, k: float) -> World:
        match kind:
            case "dry contact":
                return world.wired(contact=size * k)
            case "humid film":
                return world.wired(film=size * k)
            case "coupled loop":
                return world.wired(loop=(loop_f, loop_Q, size * k))
            case "piezo relaxation":
                return world.with_flaws(piezo=(size * k, 2 * at))
            case "neighbour":
                return world.with_flaws(neighbour=(ratio, size * k))
            case _:
                return world.with_flaws(recording=(kind, size * k, at))

    return Plant("unknown", ("any",), s.steps, put, {"size": size}, {"kind": kind}, accept=accept)
