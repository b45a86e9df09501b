"""Two drive levels, the higher one first; tests/fitters/compare/test_levels.py has the other order."""

import pytest
from driven_circuit import F, driven, noisy

from pzctl.fitters.compare.compare import compare


def test_a_lower_level_afterwards_is_told_by_the_same_numbers() -> None:
    levels = (1.0, 0.1)
    soft, lossy = 1.2e-4, 3e-3
    (before, at_before), (after, at_after) = (driven(volt, soft, lossy) for volt in levels)
    found = compare([noisy(F, before, levels[0], 1)], [noisy(F, after, levels[1], 2)])
    (finding,) = found.findings
    assert finding.effect == "drive-nonlinearity"
    largest = max(at_before, at_after)
    assert finding.parameters["softening"].value == pytest.approx(soft * largest / 2, rel=0.1), "frequency: the root"
    assert finding.parameters["loss"].value == pytest.approx(lossy * largest, rel=0.1)
