"""The families that effects are drawn from: in the leads, in the device, in the sweep, and outside the catalogue."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from . import layer_families as layered
from .device_under_test import DeviceUnderTest
from .injected_effect import InjectedEffect, field_effect, path_effect
from .scenario import Hidden

Family = Callable[[np.random.Generator, DeviceUnderTest], InjectedEffect]


def _some_steps(rng: np.random.Generator, device: DeviceUnderTest) -> tuple[str, ...]:
    """Return all steps, or sometimes only those from a later one on, as if the clip had been changed."""
    first = int(rng.integers(0, len(device.steps))) if rng.random() < 0.3 else 0
    return device.steps[first:]


def _lead(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return path_effect("lead-inductance", _some_steps(rng, s), 30.0, inductance=1e-8)


def _resistance(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return path_effect("series-resistance", _some_steps(rng, s), 30.0, resistance=0.1)


def _stray(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return path_effect("stray-capacitance", _some_steps(rng, s), 20.0, capacitance=3e-12)


def _leakage(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return path_effect("leakage", _some_steps(rng, s), 100.0, conductance=1e-5)


def _cable(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return replace(path_effect("cable", _some_steps(rng, s), 12.0, delay=5e-10), min_scale=0.2)


def _polarity(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    how = "conjugated" if rng.random() < 0.5 else "inverted"
    return field_effect(
        "polarity", ("terminals",), s.steps, lambda _: {"recorded": how}, {}, min_scale=1.0, max_scale=1.0
    )


def _resonance(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    f, Q = s.disk.f0 * float(rng.uniform(0.6, 1.3)), float(rng.uniform(30, 150))
    C = s.disk.eps33S.real * s.area / s.disk.thickness * 1e-3
    where = ("layer:disk", *(f"layer:{c.name}" for c in s.layers), *(f"interface:{c.name}|" for c in s.layers))

    def apply(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, path=replace(hidden.path, branch=(f, Q, C * scale) if scale else None))

    return InjectedEffect(
        "spurious-resonance", where, s.steps, apply, {"f": f, "Q": Q, "strength": 1e-3}, max_scale=10.0
    )


def _drift(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    c = -1e-4 * (1 if rng.random() < 0.7 else -1)
    eps = -c * float(rng.uniform(0, 30))
    return field_effect(
        "temperature-drift",
        ("sweep",),
        ("disk",),
        lambda k: {"drift": (c * k, eps * k)},
        {"stiffness": c, "permittivity": eps},
        max_scale=30.0,
        needs="up and down",
    )


def _softening(_: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return field_effect(
        "drive-nonlinearity",
        ("layer:disk",),
        s.steps,
        lambda k: {"softening": 100.0 * k},
        {"per_strain": 100.0},
        max_scale=50.0,
        needs="levels",
    )


def _settling(_: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    return field_effect(
        "sweep-lag",
        ("sweep",),
        s.steps,
        lambda k: {"settling": 1e-3 * k},
        {"time_constant": 1e-3},
        max_scale=300.0,
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
"""Weight and family of every effect in the catalogue except electrode masses, which the constants absorb."""

BOND: tuple[Family, ...] = (layered.bond, layered.void)
"""Families that need a bond."""


def outside(rng: np.random.Generator, s: DeviceUnderTest) -> InjectedEffect:
    """Return an instrument artefact that is not in the catalogue."""
    kinds = (
        *("range step", "range to and fro", "gain ripple", "phase error", "glitch", "coupled"),
        *("loose contact", "mains hum", "mixing", "flicker conductance"),
    )
    kind, at = str(rng.choice(kinds)), float(rng.uniform(0.2, 0.8))
    where = ("any",)
    if kind != "coupled":
        return field_effect(
            "unknown", where, s.steps, lambda k: {"outside": (kind, 1e-3 * k, at)}, {kind: 1e-3}, max_scale=30.0
        )
    f, Q = s.disk.f0 * float(rng.uniform(0.5, 1.4)), float(rng.uniform(3, 12))

    def apply(hidden: Hidden, scale: float) -> Hidden:
        return replace(hidden, path=replace(hidden.path, coupled=(f, Q, 1e-10 * scale) if scale else None))

    return InjectedEffect(
        "unknown", where, s.steps, apply, {"coupled": 1e-10}, max_scale=100.0, accept=("spurious-resonance",)
    )
