"""Effects that ripple over frequency are fitted in their deepest minimum."""

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.models.effects import Device, find_effect
from pzctl.models.sweep import Sweep

BUILD = """
name = "P"
diameter_mm = 16.0
layers = [{{ name = "disk", kind = "piezo", material = "Pz27", thickness_mm = {{ value = 0.512, u = 0.001 }} }}]
load = {{ back = {{ z_MRayl = 2.5 }}, front = "water" }}
steps = [{{ name = "disk", layers = ["disk"] }}]
effects = [{{ effect = "piston-radiation", where = "face:front", narrowness = {{ value = {}, u = 0.007 }} }}]
"""
F = np.linspace(0.8e6, 9e6, 401)
NARROWNESS = 0.010
NOISE = 2e-4


@pytest.mark.parametrize("stated", [0.013, 0.007])
def test_the_radiation_of_a_piston_is_found_among_its_ripples(stated: float) -> None:
    """It ended at 0.01231(1) with a chi2 of 2.28, one ripple beside the truth."""
    build = parse_build(BUILD.format(stated), "build.toml")
    piston = Device(stack_of(build, build.step("disk"))).with_effect(
        find_effect("piston-radiation"), "face:front", {"narrowness": NARROWNESS}
    )
    noise = np.random.default_rng(1).normal(size=(2, F.size))
    sweep = Sweep(F, piston.impedance(F) * np.exp(NOISE * (noise[0] + 1j * noise[1])))
    descent = solve(FitTask(build, {"disk": (sweep,)}), lambda _: None).descent
    assert descent.objective.recordings[0].misfit == 0, "described to its noise"
    values, _ = descent.objective.coordinates.forward(descent.x)
    assert values["piston-radiation@face:front.narrowness"] == pytest.approx(NARROWNESS, rel=3e-3)
