"""One device at two drive levels: softening and loss by amplitude, with their sizes.

The recordings are a nonlinear circuit's, solved by iterating the charge on each branch's capacitance;
tests/benchmarks/test_compare_levels.py has resonances that bend in both, and the softening per strain of a build.
"""

import pytest
from driven_circuit import F, driven, noisy

from pzctl.fitters.compare.compare import compare


@pytest.mark.long
def test_two_levels_are_told_by_softening_and_loss_at_the_largest_amplitude() -> None:
    levels = (0.1, 1.0)
    soft, lossy = 1.2e-4, 3e-3
    (before, at_before), (after, at_after) = (driven(volt, soft, lossy) for volt in levels)
    found = compare([noisy(F, before, levels[0], 1)], [noisy(F, after, levels[1], 2)])
    (finding,) = found.findings
    assert finding.effect == "drive-nonlinearity"
    largest = max(at_before, at_after)
    assert finding.parameters["softening"].value == pytest.approx(soft * largest / 2, rel=0.1), "frequency: the root"
    assert finding.parameters["loss"].value == pytest.approx(lossy * largest, rel=0.1)
