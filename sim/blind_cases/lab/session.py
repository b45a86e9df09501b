"""Draws a session: sweeps of many kinds, and an analyzer with errors within its specification."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..waves import Reals
from .devices.flaws import FixtureResidue
from .devices.specimen import LabDevice
from .distributions import Random, loguniform
from .planting.plant import Plant
from .recording import ErringAnalyzer, LabSweep


def plan(rng: Random, specimen: LabDevice, plants: Sequence[Plant]) -> tuple[LabSweep, ...]:
    """Return the sweeps of a session: every step, with a repeat downwards or at another level where it is needed."""
    f0, needs = specimen.ceramic.f0, {plant.needs for plant in plants}
    f = _grid(rng, f0, "a plain disk" in needs)
    seconds = float(rng.uniform(20, 130)) * f.size / 801
    sweeps: list[LabSweep] = []
    chance = rng.random()
    for step in specimen.steps:
        first = LabSweep(step, f)
        if "up and down" in needs or ("levels" not in needs and chance < 0.1):
            first = replace(first, seconds=seconds)
            sweeps += [first, replace(first, down=True, order=1)]
        elif "levels" in needs or chance > 0.95:
            sweeps += [replace(first, level_V=0.1), replace(first, level_V=1.0, order=1)]
        else:
            sweeps.append(first)
    return tuple(sweeps)


def _grid(rng: Random, f0: float, plain: bool) -> Reals:
    """Return the frequencies of a sweep in Hz: linear, logarithmic, in segments, or over one resonance only."""
    points = int(rng.choice([101, 201, 401, 801, 1601], p=[0.06, 0.14, 0.2, 0.45, 0.15]))
    low, high = [(0.12, 1.5), (0.12, 2.4), (0.117, 3.4)][int(rng.choice(3, p=[0.2, 0.3, 0.5]))]
    how = str(rng.choice(["linear", "log", "segments", "short"], p=[0.5, 0.2, 0.18, 0.12]))
    if plain:
        low, high, how = 0.45, 1.55, "linear"
        points = max(points, 401)
    if how == "short":
        low, high = float(rng.uniform(0.55, 0.75)), float(rng.uniform(1.25, 1.5))
    if how == "segments":
        near = np.linspace(0.78, 1.2, points // 2, endpoint=False)
        below, above = np.linspace(low, 0.78, points // 4, endpoint=False), np.linspace(1.2, high, points // 4 + 1)
        x = np.concatenate([below, near, above])
    else:
        x = np.geomspace(low, high, points) if how == "log" else np.linspace(low, high, points)
    return np.round(x * f0, 3)


def analyzer_of(rng: Random, sweeps: Sequence[LabSweep], specimen: LabDevice) -> ErringAnalyzer:
    """Return an analyzer within its specification, with random noise and correlation."""
    band = (min(float(t.frequency[0]) for t in sweeps), max(float(t.frequency[-1]) for t in sweeps))
    reach = float(rng.uniform(0.8, 4.0))
    rms = rng.uniform(2e-4, 1e-3, size=2)
    shapes = rng.standard_normal((2, 10)) * np.exp(-np.arange(10) / reach)
    gain, phase = (
        of / np.sqrt(of[0] ** 2 + np.sum(of[1:] ** 2) / 2) * size for of, size in zip(shapes, rms, strict=True)
    )
    typical = 1 / (2 * np.pi * specimen.ceramic.f0 * specimen.C0)
    steps = ((typical * float(np.exp(rng.normal(0, 1))), float(rng.normal(0, 3e-4))),) if rng.random() < 0.15 else ()
    sign = rng.choice([-1.0, 1.0], size=2, p=[0.3, 0.7])
    fixture = FixtureResidue(
        inductance=float(sign[0] * rng.uniform(0.1e-9, 1.2e-9)),
        resistance=float(rng.uniform(1e-3, 8e-3)),
        skin=float(rng.uniform(0, 4e-3)),
        capacitance=float(sign[1] * rng.uniform(2e-15, 20e-15)),
        conductance=float(rng.uniform(0, 2e-9)),
    )
    return ErringAnalyzer(
        band=band,
        gain=tuple(map(float, gain)),
        phase=tuple(map(float, phase)),
        steps=steps,
        noise=loguniform(rng, 5e-5, 5e-4),
        colour=float(rng.uniform(0.3, 0.85)) if rng.random() < 0.25 else 0.0,
        fixture=fixture,
        bandwidth=int(rng.choice([5, 5, 5, 3])),
    )
