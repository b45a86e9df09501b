"""Constants are told for the build as it is stated, unless the recordings contradict it."""

from dataclasses import replace

import numpy as np
import pytest
from glued_recordings import NOISE, F, glued_build, recorded

from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.recording import rms
from pzctl.fitters.error_model.as_stated import as_stated
from pzctl.fitters.error_model.error_sizes import ErrorSizes
from pzctl.fitters.error_model.marginal import Marginal
from pzctl.fitters.error_model.marginal_fit import MarginalFit, fit
from pzctl.fitters.interface import FitTask
from pzctl.models.build import Build
from pzctl.models.effects.base.corrected_constants import Corrections

BUILD = glued_build(0.008, 0.001)
HELD = ErrorSizes(held=1.0)


def marginal_of(build: Build, steps: tuple[str, ...], **glue: float) -> tuple[Marginal, np.ndarray]:
    """Return the marginal fit of recordings of a device with another glue, and its least-squares minimum."""
    solution = solve(FitTask(build, recorded(build, steps, **glue)), lambda _: None)
    return Marginal.of(solution.judged), solution.descent.x


def test_a_density_that_the_recording_does_not_tell_is_as_stated() -> None:
    """Stiffness and density moved along each other: the stiffness told missed the recording by a fifth."""
    marginal, x = marginal_of(BUILD, ("bare",))
    fitted = fit(marginal, x, (HELD,), rounds=1, fixed=True)
    coordinates = marginal.objective.coordinates
    off = {"disk.density": -0.006}
    factor = np.exp(off["disk.density"])
    values = {
        name: value * (factor if name.startswith("disk.c33D") else np.sqrt(factor) if ".h33" in name else 1.0)
        for name, value in fitted.values.items()
    }
    corrections = Corrections(np.log(F), {}, {}, off)
    moved = MarginalFit.at(
        marginal, replace(fitted.minimum, x=coordinates.inverse(values), corrections=corrections, sizes=HELD)
    )
    assert rms(*moved.marginal.residuals(moved.x)) == pytest.approx(np.sqrt(2) * NOISE, rel=0.2), "as good a fit"
    assert rms(*moved.left_by_the_model) > 0.02, "of which the constants alone are none"
    told = as_stated(moved)
    assert rms(*told.left_by_the_model) < 2 * NOISE
    assert told.values["disk.c33D.re"] == pytest.approx(fitted.values["disk.c33D.re"], rel=2e-4)


def test_a_glue_that_the_recordings_contradict_is_told_as_another() -> None:
    marginal, x = marginal_of(BUILD, ("bare", "glued"), z=4.2e6)
    found = fit(marginal, x, (HELD,), rounds=5, fixed=True)
    before, after = (one.minimum.corrections for one in (found, as_stated(found)))
    assert before is not None
    assert after is not None
    assert np.exp(before.held["glue.z"]) == pytest.approx(4.2 / 2.9, rel=0.1)
    assert after.held["glue.z"] == before.held["glue.z"]
