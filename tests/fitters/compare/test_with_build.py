"""Changes inside of a device whose build is given."""

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
    return compare([recorded(device, 1)], [recorded(change(device), 2)], BUILD, step)


@pytest.mark.parametrize(
    ("change", "effect", "where", "size", "true"),
    [
        (lambda one: replace(one, e33=15.2), "poling", "layer:disk", "ln e33", np.log(0.95)),
        (lambda one: replace(one, loose=0.2), "bond-void", "interface:disk|glue1", "fraction", 0.2),
    ],
    ids=["depoled", "glue come off"],
)
def test_a_change_inside_is_named_with_place_and_size_although_the_model_describes_neither_recording(
    change: Callable[[Disk], Disk], effect: str, where: str, size: str, true: float
) -> None:
    found = compared(change)
    assert found.verdict == "explained"
    (finding,) = found.findings
    assert (finding.effect, finding.where, finding.step, finding.removed) == (effect, where, "ml1", False)
    found_size = finding.parameters[size]
    assert found_size.value == pytest.approx(true, abs=max(3 * found_size.u, 0.05 * abs(true)))
    assert found_size.u < 0.15 * abs(true)
    assert found.described_by is not None
    assert found.described_by.rms_log_error > 20 * 2e-4, "the build lacks the lead and the spurious mode"


def test_a_load_that_is_gone_was_there_before() -> None:
    wet, dry = Disk(load=4e5), Disk()
    found = compare([recorded(wet, 1)], [recorded(dry, 2)], BUILD, "ml1")
    (finding,) = found.findings
    assert (finding.effect, finding.where, finding.removed) == ("face-load", "face:front", True)
    assert finding.parameters["resistance"].value == pytest.approx(4e5, rel=0.05)


def test_a_matching_layer_that_came_on_is_that_of_the_next_step() -> None:
    (finding,) = compare([recorded(Disk(matched=False), 1)], [recorded(Disk(), 2)], BUILD, "disk").findings
    assert (finding.effect, finding.where, finding.removed) == ("glued-layer", "layer:ml1", False)
    assert finding.parameters["ml1.z"].value == pytest.approx(10.3e6, rel=0.06)


def test_an_unchanged_device_and_a_cable_are_still_what_they_are() -> None:
    assert compared(lambda one: one).verdict == "unchanged"
    before = recorded(Disk(), 1)
    after = replace(recorded(Disk(), 2), impedance=recorded(Disk(), 2).impedance + 10.0)
    (finding,) = compare([before], [after], BUILD, "ml1").findings
    assert (finding.effect, finding.where) == ("series-resistance", "terminals")


def test_a_step_that_the_build_has_not_is_refused_in_a_sentence() -> None:
    with pytest.raises(TaskError, match="step 'lens' is not in build 'thesis', which has disk, ml1, ml2"):
        compared(lambda one: one, "lens")
