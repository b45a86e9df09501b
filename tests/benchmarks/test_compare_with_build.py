"""Further changes inside of a device whose build is given, beside those of tests/fitters/compare/test_with_build.py."""

from dataclasses import replace

import pytest
from glued_plate import Disk, recorded

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.compare.compare import compare

BUILD = read_build(THESIS_BUILD)


@pytest.mark.parametrize(
    ("changed", "effect", "where", "size", "true"),
    [
        (Disk(load=4e5), "face-load", "face:front", "resistance", 4e5 - 413),
        (Disk(dead=15e-6), "surface-layer", "layer:disk", "back", 15e-6),
        (Disk(loose=0.2), "bond-void", "interface:disk|glue1", "fraction", 0.2),
        (Disk(loose=0.35), "bond-void", "interface:disk|glue1", "fraction", 0.35),
        (replace(Disk(), e33=14.4), "poling", "layer:disk", "ln e33", -0.10536),
    ],
    ids=["load", "dead layer", "a fifth of the glue gone", "a third of the glue gone", "depoled by a tenth"],
)
def test_a_change_inside_is_named_with_place_and_size(
    changed: Disk, effect: str, where: str, size: str, true: float
) -> None:
    found = compare([recorded(Disk(), 1)], [recorded(changed, 2)], BUILD, "ml1")
    (finding,) = found.findings
    print(f"{effect}: {finding.parameters[size]}, true {true:.4g}; {found.seconds:.1f} s")
    assert (finding.effect, finding.where, finding.removed) == (effect, where, False)
    assert finding.parameters[size].value == pytest.approx(
        true, abs=max(3 * finding.parameters[size].u, 0.05 * abs(true))
    )


def test_a_load_that_is_gone_was_there_before() -> None:
    (finding,) = compare([recorded(Disk(load=4e5), 1)], [recorded(Disk(), 2)], BUILD, "ml1").findings
    assert (finding.effect, finding.where, finding.removed) == ("face-load", "face:front", True)
    assert finding.parameters["resistance"].value == pytest.approx(4e5, rel=0.05)


def test_a_matching_layer_that_came_on_is_that_of_the_next_step() -> None:
    (finding,) = compare([recorded(Disk(matched=False), 1)], [recorded(Disk(), 2)], BUILD, "disk").findings
    assert (finding.effect, finding.where, finding.removed) == ("glued-layer", "layer:ml1", False)
    assert finding.parameters["ml1.z"].value == pytest.approx(10.3e6, rel=0.06)


def test_a_resistance_in_the_cable_is_none_of_the_device() -> None:
    sweep = recorded(Disk(), 2)
    after = replace(sweep, impedance=sweep.impedance + 10.0)
    (finding,) = compare([recorded(Disk(), 1)], [after], BUILD, "ml1").findings
    assert (finding.effect, finding.where) == ("series-resistance", "terminals")


def test_a_matching_layer_that_came_off_is_that_of_the_present_step() -> None:
    (finding,) = compare([recorded(Disk(), 1)], [recorded(Disk(matched=False), 2)], BUILD, "ml1").findings
    assert (finding.effect, finding.where, finding.removed) == ("glued-layer", "layer:ml1", True)
    assert finding.parameters["ml1.z"].value == pytest.approx(10.3e6, rel=0.06)


def test_an_unchanged_device_is_unchanged() -> None:
    device = Disk(matched=False)
    assert compare([recorded(device, 1)], [recorded(device, 2)], BUILD, "disk").verdict == "unchanged"
