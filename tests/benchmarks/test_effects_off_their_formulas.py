"""Effects that real devices do not have as their formulas say: solder is no rigid mass, a void has a loose rim.

Two complete searches, two minutes.
"""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.findings import Finding
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.models.base.arrays import Complexes
from pzctl.models.build import Build
from pzctl.models.stack import Elastic
from pzctl.models.sweep import Sweep

F = np.linspace(1.5e6, 13e6, 201)
ANALYZER = np.exp(6e-4 * np.tanh(np.log(F / 4e6)) * (1 - 0.7j))
"""Gain and phase error within the specification of a 4294A."""
GLUED = ("disk", "glue1", "ml1")


def recorded(impedance: Complexes, seed: int) -> tuple[Sweep, ...]:
    noise = np.random.default_rng(seed).standard_normal((2, F.size))
    return (Sweep(F, impedance * ANALYZER * np.exp(2e-4 * (noise[0] + 1j * noise[1]))),)


def the_finding(build: Build, sweeps: dict[str, tuple[Sweep, ...]]) -> Finding:
    """Return the only finding, which has to explain the recordings."""
    found = diagnose(FitTask(build, sweeps))
    (only,) = found.findings
    assert found.verdict == "explained"
    assert only.probability is not None
    assert only.probability > 0.85
    return only


def test_elastic_solder_is_a_local_mass_and_nothing_beside_it() -> None:
    build = read_build(THESIS_BUILD)
    free = stack_of(build, build.step("disk"))
    # 35 um of tin and lead, an eighth heavier at the third harmonic than at the first
    solder = Elastic("solder", thickness=35e-6, z=8500.0 * 2030.0, c=2030.0, q=20.0)
    loaded = replace(free, layers=(*free.layers, solder))
    whole = 0.95 / free.impedance(F) + 0.05 / loaded.impedance(F)
    dot = the_finding(build, {"disk": recorded(1 / whole, 5)})
    assert dot.effect == "local-mass"
    assert dot.parameters["fraction"].value == pytest.approx(0.05, rel=0.2)
    assert dot.parameters["mass"].value == pytest.approx(8500.0 * 35e-6, rel=0.1)


def test_a_void_with_a_loose_rim_is_a_void_and_nothing_beside_it() -> None:
    whole = read_build(THESIS_BUILD)
    build = replace(
        whole,
        layers=tuple(layer for layer in whole.layers if layer.name in GLUED),
        steps=(whole.step("disk"), replace(whole.step("ml1"), layers=GLUED)),
    )
    bare, bonded = (stack_of(build, step) for step in build.steps)
    disk, glue, layer = bonded.layers
    assert isinstance(glue, Elastic)
    loose = replace(glue, z=0.4 * glue.z, c=0.4 * glue.c, q=8.0)
    rim = replace(bonded, layers=(disk, loose, layer))
    admittance = 0.86 / bonded.impedance(F) + 0.09 / bare.impedance(F) + 0.05 / rim.impedance(F)
    void = the_finding(build, {"disk": recorded(bare.impedance(F), 6), "ml1": recorded(1 / admittance, 7)})
    assert void.effect == "bond-void"
    assert void.parameters["fraction"].value == pytest.approx(0.09, rel=0.1)
    assert void.parameters["rim"].value == pytest.approx(0.05 / 0.09, rel=0.3)
