"""Every model's exact derivatives compared with sixth-order differences."""

from dataclasses import replace

import numpy as np
import pytest
from fixture_path import Fixture

from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.circuits.terminals import Scale, Series, Shunt, TransmissionLine
from pzctl.models.disk.round_disk import BothModes, RadialDisk
from pzctl.models.materials import SHERRIT_RADIAL
from pzctl.models.stack import AIR, CausalConstantQ, Elastic, Piezo, PowerLoss, Stack

WEIGHTS = np.array([-1, 9, -45, 45, -9, 1]) / 60
STEPS = np.array([-3, -2, -1, 1, 2, 3])

LUMPED = Lumped(
    1.2e-9, (Branch.from_resonance(4.2e6, 80, 2.2e-10), Branch.from_resonance(4.6e6, 40, 1e-11)), 0.017, 0.5, 3e-8
)
AREA, THICKNESS = 7.85e-5, 0.5e-3
THICK = {"disk.alpha": 0.75, "disk.d33f": 1.4e-10}
DISK = RadialDisk.of("disk", SHERRIT_RADIAL, AREA, THICKNESS, 7800).replace(THICK)
LAWS = {"s11E": PowerLoss(1e5, 0.3), "s12E": CausalConstantQ(1e5), "d31": CausalConstantQ(1e5)}
LAWFUL = RadialDisk(replace(DISK.arm, laws=LAWS), DISK.eps33T, PowerLoss(1e5, -0.2))
STACK = Stack(
    (
        Piezo("disk", THICKNESS, 7800, 1.5e11 * (1 + 0.01j), 2e9 + 1e7j, 1e-8 * (1 - 0.02j)),
        Elastic("ml1", 139e-6, 1e7, 2455, 60),
    ),
    AIR,
    AIR,
    AREA,
)
BOTH = BothModes.of(STACK, "disk", SHERRIT_RADIAL).replace(THICK)
PATH = (
    Series(3e-8, 0.3, 0.1), Shunt(2e-12, 2e-6), TransmissionLine(0.7, 50.0, 2e8, 1e-3),
    Shunt(1e-13, 1e-7), Series(1e-9, 0.01, 0.001), Scale(1.002, 3e-11),
)  # fmt: skip
RADIAL_BAND = np.linspace(40e3, 900e3, 87)
MODELS = {
    "lumped": (LUMPED, np.linspace(1e6, 15e6, 61)),
    "radial": (DISK, RADIAL_BAND),
    "radial with laws": (LAWFUL, RADIAL_BAND),
    "both modes": (BOTH, np.geomspace(4e4, 1e7, 97)),
    "lumped in a fixture": (Fixture(LUMPED, *PATH), np.linspace(1e6, 15e6, 61)),
    "stack in a fixture": (Fixture(STACK, *PATH), np.linspace(1e6, 15e6, 61)),
    "stack in a null fixture": (Fixture(STACK), np.linspace(1e6, 15e6, 61)),
}


# Size of a step where the value itself is zero.
NULL_SIZES = {
    "inductance": 1e-9, "resistance": 0.1, "skin": 0.1, "capacitance": 1e-12, "conductance": 1e-6, "length": 0.1,
    "loss": 1e-3, "delay": 1e-10,
}  # fmt: skip


def step_of(model, name):
    return 1e-4 * (abs(model.parameters()[name]) or NULL_SIZES[name.split(".")[1]])


def differences(model, frequency, name):
    """d ln Z / d name by a sixth-order difference."""
    value = model.parameters()[name]
    h = step_of(model, name)
    Z = [model.replace({name: value + k * h}).impedance(frequency) for k in STEPS]
    logs = np.log(Z / model.impedance(frequency))
    return WEIGHTS @ logs / h


@pytest.mark.parametrize("which", MODELS)
def test_derivatives_are_exact(which):
    model, frequency = MODELS[which]
    names = list(model.parameters())
    Z, J = model.jacobian(frequency, names)
    assert np.array_equal(Z, model.impedance(frequency))
    assert J.shape == (len(names), frequency.size)
    for row, name in zip(J, names, strict=True):
        expected = differences(model, frequency, name)
        rounding = 1e-14 / step_of(model, name)  # error of the differences, not of the derivative
        assert np.abs(row - expected).max() < 1e-8 * np.abs(row).max() + rounding, name


@pytest.mark.parametrize("which", MODELS)
def test_unknown_names_are_refused_with_the_known_ones(which):
    model, frequency = MODELS[which]
    known = next(iter(model.parameters()))
    with pytest.raises(KeyError, match=rf"typo.*{known}"):
        model.replace({"typo": 1.0})
    with pytest.raises(KeyError, match=rf"typo.*{known}"):
        model.jacobian(frequency, ["typo"])
