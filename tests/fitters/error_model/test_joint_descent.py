"""Descents over constants and errors together: derivatives of what the model contains, and where they arrive."""

from dataclasses import replace

import numpy as np
import pytest
from glued_recordings import glued_build, recorded

from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.objective import Objective
from pzctl.fitters.engine.parameters.assembly import nominal_parameters, without_vanished
from pzctl.fitters.error_model.error_sizes import ErrorSizes
from pzctl.fitters.error_model.joint_descent import JointPoint, descend
from pzctl.fitters.error_model.marginal import Marginal
from pzctl.fitters.error_model.marginal_fit import fit
from pzctl.fitters.error_model.uncertainty_sources import taken_up
from pzctl.fitters.interface import FitTask
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

ALL = ErrorSizes(tau=3e-4, slow=1.0, fixture=1.0, held=1.0, losses=1.0)


@pytest.fixture
def build() -> Build:
    """Two gluing steps, whose glue has library values."""
    return glued_build(0.006, 0.004)


def judged(build: Build, sweeps: dict[str, tuple[Sweep, ...]]) -> Objective:
    return solve(FitTask(build, sweeps), lambda _: None).judged


def test_columns_are_derivatives_of_the_model_that_contains_the_errors(build: Build) -> None:
    """Also of layers, and of what is across the device behind ohms in series: half or twice of it leads nowhere."""
    objective = judged(build, recorded(build))
    marginal, x = Marginal.of(objective), objective.coordinates.x
    columns = marginal.columns(x)
    rng = np.random.default_rng(1)
    on, d = columns.present(ALL.of_columns())
    scale = np.zeros(len(columns.parts))
    scale[on] = d
    a = scale * rng.normal(size=scale.size)
    point = JointPoint.at(marginal.centred(columns.means), x, columns, ALL, a).with_errors(a).refreshed()
    contained = np.flatnonzero(point.contained.there)
    names = {own.name for k in contained if (own := point.held.columns.corrections[k]) is not None}
    assert {"series", "shunt", "disk.c33D", "ml.z", "ml.c", "held:glue.z"} <= names
    for k in contained:
        step = 1e-5 * max(scale[k], 1e-3)
        moved = point.with_errors(point.a + step * (np.arange(a.size) == k))
        for after, before, block in zip(moved.residuals, point.residuals, point.held.columns.blocks, strict=True):
            largest = np.max(np.abs(block[:, k]))
            assert np.max(np.abs((after - before) / step - block[:, k])) <= 0.03 * largest + 1e-7


def test_a_descent_only_lowers_the_joint_density(build: Build) -> None:
    objective = judged(build, recorded(build, z=3.4e6))
    marginal, x = Marginal.of(objective), objective.coordinates.x
    columns = marginal.columns(x)
    begun = JointPoint.at(marginal.centred(columns.means), x, columns, ALL, np.zeros(len(columns.parts)))
    end, _ = descend(begun)
    own = replace(end, fresh=False).refreshed()
    assert own.here == pytest.approx(end.here, abs=0.5)  # derivatives of where it began have led to a true value
    assert own.here < begun.here


@pytest.mark.parametrize(("z", "c"), [(3.6e6, 2300.0), (2.4e6, 2700.0)])
def test_a_glue_that_is_not_the_librarys_is_found_from_the_build(build: Build, z: float, c: float) -> None:
    """As probable as from the truth. With errors linear about the library's glue it was hundreds of nats less."""
    objective = judged(build, recorded(build, z=z, c=c, thickness=8e-6))
    marginal, coordinates = Marginal.of(objective), objective.coordinates
    truth = coordinates.inverse({**coordinates.forward(coordinates.x)[0], **_true(build, z, c)})
    found = [fit(marginal, x, (ErrorSizes(),), rounds=5) for x in (coordinates.x, truth)]
    assert found[0].log_evidence > found[1].log_evidence - 3
    assert found[0].shortfall == 0
    corrections = found[0].minimum.corrections
    assert corrections
    assert np.exp(corrections.held["glue.z"]) == pytest.approx(z / 2.9e6, rel=0.1)
    off = taken_up(found[0]).off
    assert next(iter(off)) == "glue.z", "what changes the impedance most is told first"
    assert 1 + off["glue.z"] == pytest.approx(z / 2.9e6, rel=0.15)


def test_a_layer_that_has_vanished_comes_back(build: Build) -> None:
    """Least squares without errors may drive a glue to nothing; the logarithm of its thickness has no way back."""
    objective = judged(build, recorded(build, z=3.6e6, thickness=8e-6))
    coordinates = objective.coordinates
    gone = {**coordinates.forward(coordinates.x)[0], "glue.thickness": 1e-60}
    lost, found = (
        fit(Marginal.of(objective), coordinates.inverse(values), (ErrorSizes(),), rounds=5)
        for values in (gone, without_vanished(build, gone))
    )
    assert lost.values["glue.thickness"] < 1e-9
    assert found.values["glue.thickness"] == pytest.approx(8e-6, rel=0.3)
    assert found.log_evidence > lost.log_evidence + 100


def _true(build: Build, z: float, c: float) -> dict[str, float]:
    """Return the nominal values, and the thickness that makes the library's glue as compliant as the true one."""
    return {**nominal_parameters(build), "glue.thickness": 8e-6 * 2.9e6 * 2550 / (z * c)}
