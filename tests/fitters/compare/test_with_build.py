"""Changes inside of a device whose build is given; tests/benchmarks/test_compare_with_build.py has all points."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from glued_plate import Disk, recorded

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.compare.compare import compare
from pzctl.fitters.compare.comparison import Comparison
from pzctl.fitters.compare.resonances import Resonances
from pzctl.fitters.compare.with_build.found_device import FoundDevice
from pzctl.fitters.compare.with_build.recorded_step import refuse_absent, step_doubt
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import TaskError
from pzctl.models.sweep import Sweep

BUILD = read_build(THESIS_BUILD)
NONE = Resonances(np.zeros(0, complex), np.zeros(0, complex))


def compared(change: Callable[[Disk], Disk], step: str = "ml1") -> Comparison:
    device = Disk(matched=step != "disk")
    before, after = (
        replace(sweep, frequency=sweep.frequency[::2], impedance=sweep.impedance[::2])
        for sweep in (recorded(device, 1), recorded(change(device), 2))
    )
    return compare([before], [after], BUILD, step)


@pytest.mark.long
def test_a_change_inside_is_named_with_place_and_size_although_the_model_describes_neither_recording() -> None:
    found = compared(lambda one: replace(one, e33=15.2))
    true = np.log(0.95)
    assert found.verdict == "explained"
    (finding,) = found.findings
    assert (finding.effect, finding.where, finding.step, finding.removed) == ("poling", "layer:disk", "ml1", False)
    found_size = finding.parameters["ln e33"]
    assert found_size.value == pytest.approx(true, abs=max(3 * found_size.u, 0.05 * abs(true)))
    assert found_size.u < 0.15 * abs(true)
    assert found.described_by is not None
    assert found.described_by.rms_log_error > 20 * 2e-4, "the build lacks the lead and the spurious mode"


def test_a_recording_of_the_step_before_is_told_from_one_of_the_step() -> None:
    f, rng = np.linspace(2e6, 7e6, 101), np.random.default_rng(1)
    steps = (stack_of(BUILD, BUILD.step(name)).impedance(f) for name in ("disk", "ml1"))
    bare, glued = (Sweep(f, Z * np.exp(1e-4 * (rng.normal(size=(2, f.size)).T @ [1, 1j]))) for Z in steps)
    of_ml1 = FoundDevice.of(BUILD, "ml1", [glued], glued.impedance, NONE)
    right, wrong = (FoundDevice.of(BUILD, "disk", [one], one.impedance, NONE) for one in (glued, bare))
    assert step_doubt(of_ml1, right) == ()
    (says,) = step_doubt(of_ml1, wrong)
    assert says.startswith("Step 'disk' describes the recording before as well as step 'ml1' does")
    refuse_absent(BUILD, of_ml1, "disk")
    nothing = of_ml1.x - 8.0 * (np.array(of_ml1.coordinates.free) == "ml1.z")
    with pytest.raises(TaskError, match=r"not of step 'ml1' of build 'thesis': it shows no 'ml1'; is it"):
        refuse_absent(BUILD, replace(of_ml1, x=nothing), "disk")


def test_a_step_that_the_build_has_not_is_refused_in_a_sentence() -> None:
    with pytest.raises(TaskError, match="step 'lens' is not in build 'thesis', which has disk, ml1, ml2"):
        compared(lambda one: one, "lens")
