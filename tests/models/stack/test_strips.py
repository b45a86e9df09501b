"""Parallel stacks evaluated together, compared with each of them separately."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from pzctl.models.stack import AIR, Elastic, HalfSpace, Piezo, Stack, parallel_admittance, parallel_jacobian

FREQUENCY = np.linspace(1e6, 6e6, 301)
DISK = Piezo("disk", thickness=0.5e-3, density=7700.0, c33D=1.44e11 * (1 + 1j / 80), h33=2e9, eps33S=8e-9 * (1 - 0.02j))
GLUE = Elastic("glue", thickness=10e-6, z=2.8e6, c=2450.0, q=13.0)
LAYER = Elastic("ml1", thickness=139e-6, z=10.3e6, c=2455.0, q=60.0)
STACK: Stack = (AIR | DISK | GLUE | LAYER | AIR).with_area(2e-4)


@pytest.mark.parametrize(
    "changes",
    [
        [{"disk.thickness": 0.5e-3 * part} for part in (0.98, 1.0, 1.03)],
        [{"glue.thickness": 10e-6 * part} for part in (0.5, 1.0, 1.7)],
        [{"ml1.thickness": 1e-4}, {"disk.thickness": 0.4e-3}],
        [{"ml1.thickness": 1e-4}, {"ml1.q": 20.0}],
        [{"ml1.thickness": 1e-4}],
    ],
)
def test_stacks_evaluated_together_equal_separate_ones(changes: list[dict[str, float]]) -> None:
    check([STACK.replace(change) for change in changes])


@pytest.mark.parametrize("connection", ["series", "parallel"])
def test_a_strip_may_have_several_piezoelectric_layers(connection: Literal["series", "parallel"]) -> None:
    second = replace(DISK, name="second", thickness=0.3e-3)
    stack = Stack((DISK, GLUE, second), AIR, AIR, 2e-4, connection)
    check([stack.replace({"disk.thickness": t}) for t in (1e-4, 2e-4, 3e-4)])
    check([stack.replace({"glue.thickness": t}) for t in (1e-5, 2e-5, 3e-5)])


def test_strips_of_different_layers_and_loads_are_summed() -> None:
    bare: Stack = (AIR | DISK | AIR).with_area(2e-4)
    wet: Stack = (AIR | DISK | HalfSpace("water", 1.5e6)).with_area(2e-4)
    check([stack.replace({"disk.thickness": t}) for t in (4e-4, 5e-4, 6e-4) for stack in (bare, STACK, wet)])


@pytest.mark.parametrize("layer", ["disk", "glue"])
def test_derivatives_of_strips_equal_those_of_separate_stacks(layer: str) -> None:
    thickness = STACK.parameters()[f"{layer}.thickness"]
    stacks = STACK.of_thicknesses(layer, [thickness * part for part in (0.98, 1.0, 1.03)])
    names = [f"{layer}.thickness", "disk.c33D.im", "glue.z", "ml1.q", "area"]
    fractions, scale = np.array([0.2, 0.5, 0.3]), np.array([[0.98 + 0.02 * k, 1, 2, 3, 4] for k in range(3)])
    together = parallel_jacobian(stacks, fractions, FREQUENCY, names, scale)
    assert together is not None
    total, slopes = np.zeros(FREQUENCY.size, complex), np.zeros((len(names), FREQUENCY.size), complex)
    for stack, fraction, own in zip(stacks, fractions, scale, strict=True):
        Z, by_name = stack.jacobian(FREQUENCY, names)
        total += fraction / Z
        slopes -= fraction / Z * own[:, None] * by_name
    np.testing.assert_allclose(together[0], total, rtol=1e-12)
    np.testing.assert_allclose(together[1], slopes, rtol=1e-9, atol=1e-12 * np.abs(slopes).max(axis=1)[:, None].max())


def check(stacks: list[Stack]) -> None:
    """Compare the sum of these stacks with each evaluated separately."""
    fractions = [1 / (2 + k) for k in range(len(stacks))]
    alone = sum(part / stack.impedance(FREQUENCY) for part, stack in zip(fractions, stacks, strict=True))
    np.testing.assert_allclose(parallel_admittance(stacks, fractions, FREQUENCY), alone, rtol=1e-12)
