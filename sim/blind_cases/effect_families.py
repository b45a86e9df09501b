"""The families that plants are drawn from: on the way to the device, in it, in the sweep, and of no catalogue."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from . import layer_families as layered
from .device_under_test import DeviceUnderTest
from .injected_effect import InjectedEffect, path_plant, slot_plant
from .scenario import Hidden

Family = Callable[[np.random.Generator, DeviceUnderTest], InjectedEffect]


def _some_steps(rng: np.random.Generator, specimen: DeviceUnderTest) -> tuple[str, ...]:
    """Return all steps, or sometimes those from a later one on: another clip."""
    first = int(rng.integers(0, len(specimen.steps))) if rng.random() < 0.3 else 0
    return specimen.steps[first:]


def _lead(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return path_plant("lead-inductance", _some_steps(rng, s), 30.0, inductance=1e-8)


def _resistance(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return path_plant("series-resistance", _some_steps(rng, s), 30.0, resistance=0.1)


def _stray(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return path_plant("stray-capacitance", _some_steps(rng, s), 20.0, capacitance=3e-12)


def _leakage(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return path_plant("leakage", _some_steps(rng, s), 100.0, conductance=1e-5)


def _cable(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return replace(path_plant("cable", _some_steps(rng, s), 12.0, delay=5e-10), least=0.2)


def _polarity(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    how = "conjugated" if rng.random() < 0.5 else "inverted"
    return slot_plant("polarity", ("terminals",), s.steps, lambda _: {"recorded": how}, {}, least=1.0, most=1.0)


def _resonance(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    f, Q = s.disk.f0 * float(rng.uniform(0.6, 1.3)), float(rng.uniform(30, 150))
    C = s.disk.eps33S.real * s.area / s.disk.thickness * 1e-3
    where = ("layer:disk", *(f"layer:{c.name}" for c in s.coats), *(f"interface:{c.name}|" for c in s.coats))

    def put(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, path=replace(hidden.path, branch=(f, Q, C * scale) if scale else None))

    return InjectedEffect("spurious-resonance", where, s.steps, put, {"f": f, "Q": Q, "strength": 1e-3}, most=10.0)


def _drift(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
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


def _softening(_: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return slot_plant(
        "drive-nonlinearity",
        ("layer:disk",),
        s.steps,
        lambda k: {"softening": 100.0 * k},
        {"per_strain": 100.0},
        most=50.0,
        needs="levels",
    )


def _settling(_: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
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
    *(
        (1.0, layered.dot),
        (1.3, layered.bond),
        (1.3, layered.void),
        (1.5, layered.taper),
        (1.0, layered.surface),
        (1.0, layered.modes),
    ),
    *((1.0, layered.loss), (1.0, layered.dielectric), (1.0, layered.face), (0.8, layered.backing), (1.0, _resonance)),
    *((1.0, _drift), (1.0, _softening), (0.8, _settling)),
)
"""Weight and family of everything that DESIGN's table names, electrode masses apart: those hide."""

BOND: tuple[Family, ...] = (layered.bond, layered.void)
"""Families that need something glued on."""


def outside(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return a flaw that no catalogue has."""
    kinds = (
        *("range step", "range to and fro", "gain ripple", "phase error", "glitch", "coupled"),
        *("loose contact", "mains hum", "mixing", "flicker conductance"),
    )
    kind, at = str(rng.choice(kinds)), float(rng.uniform(0.2, 0.8))
    where = ("any",)
    if kind != "coupled":
        return slot_plant(
            "unknown", where, s.steps, lambda k: {"outside": (kind, 1e-3 * k, at)}, {kind: 1e-3}, most=30.0
        )
    f, Q = s.disk.f0 * float(rng.uniform(0.5, 1.4)), float(rng.uniform(3, 12))

    def put(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, path=replace(hidden.path, coupled=(f, Q, 1e-10 * scale) if scale else None))

    return InjectedEffect(
        "unknown", where, s.steps, put, {"coupled": 1e-10}, most=100.0, accept=("spurious-resonance",)
    )
