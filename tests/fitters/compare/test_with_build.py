"""Changes inside of a device whose build is given; tests/benchmarks/test_compare_with_build.py has all points."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from glued_plate import Disk, recorded

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.compare.compare import compare
from pzctl.fitters.compare.comparison import Comparison
from pzctl.fitters.interface import TaskError

BUILD = read_build(THESIS_BUILD)


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


def test_a_step_that_the_build_has_not_is_refused_in_a_sentence() -> None:
    with pytest.raises(TaskError, match="step 'lens' is not in build 'thesis', which has disk, ml1, ml2"):
        compared(lambda one: one, "lens")
