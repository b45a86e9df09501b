"""A line of glue that the build omits, softer and lossier than any prior of the build tells.

A complete search over two steps, half a minute.
"""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.models.stack import Elastic, Stack
from pzctl.models.sweep import Sweep

F = np.linspace(1.5e6, 7.5e6, 101)


def test_half_cured_glue_is_found_alone_though_other_effects_promise_more() -> None:
    whole = read_build(THESIS_BUILD)
    disk, ml1 = whole.steps[:2]
    build = replace(
        whole,
        layers=tuple(layer for layer in whole.layers if layer.name in ("disk", "ml1")),
        steps=(disk, replace(ml1, layers=("disk", "ml1"))),
    )
    bare, layer = (stack_of(build, step) for step in build.steps)
    line = Elastic("line", thickness=9e-6, z=2.4e6, c=2200.0, q=12.0)
    glued = replace(layer, layers=(layer.layers[0], line, *layer.layers[1:]))
    random = np.random.default_rng(3)

    def recorded(stack: Stack) -> tuple[Sweep, ...]:
        noise = random.standard_normal((2, F.size))
        return (Sweep(F, stack.impedance(F) * np.exp(2e-4 * (noise[0] + 1j * noise[1]))),)

    found = diagnose(FitTask(build, {"disk": recorded(bare), "ml1": recorded(glued)}))
    (bond,) = found.findings
    assert (found.verdict, bond.effect, bond.where) == ("explained", "bond-layer", "interface:disk|ml1")
    assert bond.probability is not None
    assert bond.probability > 0.9
    thickness, loss = bond.parameters["thickness"], bond.parameters["loss"]
    compliance = line.thickness / (line.z * line.c) * 2.9e6 * 2550.0
    assert abs(thickness.value - compliance) < 3 * thickness.u + 0.05 * compliance
    assert loss.value == pytest.approx(1 / line.q, rel=0.05)
