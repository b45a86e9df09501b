import numpy as np
import pytest

from pzctl.models.circuits.lumped import Branch, Lumped, LumpedError


def test_resonance_and_quality_are_those_of_its_construction():
    branch = Branch.from_resonance(4e6, 80, 1e-10)
    assert (branch.fs, branch.Q, branch.C) == pytest.approx((4e6, 80, 1e-10))


def test_at_series_resonance_only_the_resistances_remain():
    branch = Branch.from_resonance(4e6, 80, 1e-10)
    circuit = Lumped(1e-15, (branch,), R=2.0)
    assert circuit.impedance(np.array([4e6]))[0] == pytest.approx(2.0 + branch.R, rel=1e-4)


def test_far_below_and_far_above_it_is_a_capacitor():
    branch = Branch.from_resonance(4e6, 80, 2e-10)
    circuit = Lumped(1e-9, (branch,), tan_delta=0.02)
    f = np.array([40.0, 4e9])
    C = 1 / (2j * np.pi * f * circuit.impedance(f))
    assert C[0] == pytest.approx(1e-9 * (1 - 0.02j) + 2e-10, rel=1e-6)
    assert C[1] == pytest.approx(1e-9 * (1 - 0.02j), rel=1e-5)


def test_an_element_that_cannot_exist_is_refused_by_name():
    with pytest.raises(LumpedError, match=r"branch1\.L is -1e-06; a positive number"):
        Lumped(1e-9, (Branch(1.0, -1e-6, 1e-10),))
