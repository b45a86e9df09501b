"""Strips of different thickness evaluated together, compared with each of them as a stack of its own."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from pzctl.models.stack import AIR, Bolt, Elastic, Piezo, Stack, Strips

FREQUENCY = np.linspace(1e6, 6e6, 301)
DISK = Piezo("disk", thickness=0.5e-3, density=7700.0, c33D=1.44e11 * (1 + 1j / 80), h33=2e9, eps33S=8e-9 * (1 - 0.02j))
GLUE = Elastic("glue", thickness=10e-6, z=2.8e6, c=2450.0, q=13.0)
LAYER = Elastic("ml1", thickness=139e-6, z=10.3e6, c=2455.0, q=60.0)
STACK: Stack = (AIR | DISK | GLUE | LAYER | AIR).with_area(2e-4)
FACTORS, FRACTIONS = np.linspace(0.9, 1.15, 30), np.linspace(0.01, 0.06, 30)


@pytest.mark.parametrize("layer", ["disk", "glue", "ml1"])
def test_strips_together_equal_separate_stacks(layer: str) -> None:
    check(STACK, layer)
    check(replace(STACK, bolt=Bolt("disk", "ml1", 8e8)), layer)


@pytest.mark.parametrize("connection", ["series", "parallel"])
def test_a_strip_may_have_several_piezoelectric_layers(connection: Literal["series", "parallel"]) -> None:
    stack = Stack((DISK, GLUE, replace(DISK, name="second", thickness=0.3e-3)), AIR, AIR, 2e-4, connection)
    check(stack, "disk")
    check(stack, "glue")


def check(stack: Stack, layer: str) -> None:
    """Compare admittance and derivatives of strips with those of stacks whose layer has each of these thicknesses."""
    name = f"{layer}.thickness"
    t, names = stack.parameters()[name], list(stack.parameters())
    scale = np.ones((FACTORS.size, len(names)))
    scale[:, names.index(name)] = FACTORS
    total, slopes = np.zeros(FREQUENCY.size, complex), np.zeros((len(names), FREQUENCY.size), complex)
    for factor, fraction, own in zip(FACTORS, FRACTIONS, scale, strict=True):
        Z, by_name = stack.replace({name: t * factor}).jacobian(FREQUENCY, names)
        total += fraction / Z
        slopes -= fraction / Z * own[:, None] * by_name
    strips = Strips(layer, FACTORS, FRACTIONS)
    Y, by_name = strips.jacobian(stack, FREQUENCY, names)
    for together in (Y, strips.admittance(stack, FREQUENCY)):
        np.testing.assert_allclose(together, total, rtol=1e-11)
    for one, alone in zip(by_name, slopes, strict=True):
        np.testing.assert_allclose(one, alone, rtol=1e-9, atol=1e-10 * np.abs(alone).max())
