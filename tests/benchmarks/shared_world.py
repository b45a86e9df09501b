"""A simulated laboratory: devices of its own kinds, each with its own imperfections, on one bench."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.interface import FitTask
from pzctl.models.sweep import Sweep
from pzctl.sim.blind_cases.lab.devices.random_specimen import random_specimen
from pzctl.sim.blind_cases.lab.devices.specimen import LabDevice
from pzctl.sim.blind_cases.lab.draw import LabSession
from pzctl.sim.blind_cases.lab.files import build_text, measured
from pzctl.sim.blind_cases.lab.planting.imperfections import imperfections
from pzctl.sim.blind_cases.lab.planting.plant import LabScenario, LabWorld
from pzctl.sim.blind_cases.lab.recording import LabSweep
from pzctl.sim.blind_cases.lab.session import analyzer_of

BAND = 3.2e6, 4.8e6
"""Resonances of the disks of this laboratory, Hz."""
FREQUENCY = np.linspace(1.0e6, 8.0e6, 401)


def laboratory(seed: int, count: int, inductance: float, own: float = 0.0) -> Mapping[str, FitTask]:
    """Return the tasks of bare disks on one bench whose lead is not compensated.

    `own`: standard deviation of the inductance from sample to sample, relative.
    """
    rng = np.random.default_rng([seed, 77])
    specimens = [_disk(rng, f"S{k + 1}") for k in range(count)]
    sweep = LabSweep("disk", FREQUENCY)
    analyzer = analyzer_of(rng, [sweep], specimens[0])
    tasks: dict[str, FitTask] = {}
    for specimen in specimens:
        world = LabWorld(specimen, fixture=analyzer.fixture)
        scenario = LabScenario(world, imperfections(rng, specimen))
        case = LabSession(specimen.name, "imperfect", scenario, (sweep,), analyzer, (), 0)
        size = max(0.0, inductance * (1 + own * float(rng.standard_normal())))
        z = measured(case, sweep, rng) + 2j * np.pi * FREQUENCY * size
        build = parse_build(build_text(case), specimen.name)
        tasks[specimen.name] = FitTask(build, {"disk": (Sweep(FREQUENCY, z, {"oscillator_V": 0.5}),)})
    return tasks


def true_inductance(seed: int, inductance: float) -> float:
    """Return what the lead and the fixture's residue have together, H."""
    rng = np.random.default_rng([seed, 77])
    count = 12
    specimens = [_disk(rng, f"S{k + 1}") for k in range(count)]
    return inductance + analyzer_of(rng, [LabSweep("disk", FREQUENCY)], specimens[0]).fixture.inductance


def _disk(rng: np.random.Generator, name: str) -> LabDevice:
    """Return a bare disk whose resonance lies in the band."""
    while True:
        one = random_specimen(rng, name, 1, backed=False, ceramic_only=True)
        if one.ceramic.kind in ("soft", "hard") and BAND[0] < one.ceramic.f0 < BAND[1]:
            return replace(one, name=name)
