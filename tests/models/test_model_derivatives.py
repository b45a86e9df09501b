"""Every model's exact derivatives against sixth-order differences."""

import numpy as np
import pytest

from pzctl.models.lumped import Branch, Lumped

WEIGHTS = np.array([-1, 9, -45, 45, -9, 1]) / 60
STEPS = np.array([-3, -2, -1, 1, 2, 3])

LUMPED = Lumped(
    1.2e-9, (Branch.from_resonance(4.2e6, 80, 2.2e-10), Branch.from_resonance(4.6e6, 40, 1e-11)), 0.017, 0.5, 3e-8
)
MODELS = {
    "lumped": (LUMPED, np.linspace(1e6, 15e6, 61)),
}


def differences(model, frequency, name, scale):
    """d ln Z / d name by a sixth-order difference; `scale` is the size that a parameter worth zero has."""
    value = model.parameters()[name]
    h = 1e-4 * (abs(value) or scale)
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
        expected = differences(model, frequency, name, 1e-3)
        assert np.abs(row - expected).max() < 1e-8 * np.abs(row).max(), name


@pytest.mark.parametrize("which", MODELS)
def test_unknown_names_are_refused_with_the_known_ones(which):
    model, frequency = MODELS[which]
    known = next(iter(model.parameters()))
    with pytest.raises(KeyError, match=rf"typo.*{known}"):
        model.replace({"typo": 1.0})
    with pytest.raises(KeyError, match=rf"typo.*{known}"):
        model.jacobian(frequency, ["typo"])
