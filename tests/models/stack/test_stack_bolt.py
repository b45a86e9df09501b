"""A bolt beside the layers: closed form of a plate with a spring from face to face, limits, exact derivatives."""

from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from pzctl.models.stack import VACUUM, Bolt, Elastic, HalfSpace, Piezo, Stack, StackError

AREA, DENSITY, LENGTH = 2e-4, 7700.0, 2e-3
C33D, H33, EPS33S = 1.5e11 * (1 + 0.012j), 1.95e9 * (1 + 0.002j), 8.4e-9 * (1 - 0.015j)
F = np.linspace(5e4, 2.5e6, 400)


def piezo(name: str, thickness: float = LENGTH, polarity: int = 1) -> Piezo:
    return Piezo(name, thickness, DENSITY, C33D, H33, EPS33S, polarity)


def film(name: str) -> Elastic:
    """A layer that holds an end of the bolt and does nothing else."""
    return Elastic(name, thickness=1e-15, z=3e6, c=2500.0)


SANDWICH = Stack(
    (
        Elastic("tail", thickness=8e-3, z=4.6e7, c=5900.0, q=500.0),
        piezo("ring1"),
        Elastic("glue", thickness=1e-5, z=2.8e6, c=2500.0, q=20.0),
        piezo("ring2", 2.1e-3, -1),
        Elastic("head", thickness=1e-2, z=1.7e7, c=6300.0, q=800.0),
    ),
    HalfSpace("oil", 4e5),
    HalfSpace("water", 1.5e6),
    AREA,
    bolt=Bolt("tail", "head", 8e8),
)


@pytest.mark.parametrize("stiffness", [1e6, 1e9, 5e9, 1e13])
def test_a_plate_with_a_spring_from_face_to_face(stiffness: float) -> None:
    """u = A sin kx from the middle; at the faces c du/dx - h D + 2 K u / area = 0."""
    w = 2 * np.pi * F
    k, spring = w * np.sqrt(DENSITY / C33D), stiffness / AREA
    sin, cos = np.sin(k * LENGTH / 2), np.cos(k * LENGTH / 2)
    Z = (LENGTH / EPS33S - 2 * H33**2 * sin / (C33D * k * cos + 2 * spring * sin)) / (1j * w * AREA)
    stack = Stack((film("a"), piezo("disk"), film("b")), VACUUM, VACUUM, AREA, bolt=Bolt("a", "b", stiffness))
    np.testing.assert_allclose(stack.impedance(F), Z, rtol=1e-8)


def test_a_soft_bolt_is_none() -> None:
    soft = replace(SANDWICH, bolt=Bolt("tail", "head", 1e-3))
    np.testing.assert_allclose(soft.impedance(F), replace(SANDWICH, bolt=None).impedance(F), rtol=1e-9)


@pytest.mark.parametrize("connection", ["series", "parallel"])
@pytest.mark.parametrize("ends", [("tail", "head"), ("ring1", "head"), ("tail", "ring2")])
def test_derivatives_are_those_of_the_impedance(
    connection: Literal["series", "parallel"], ends: tuple[str, str]
) -> None:
    stack = replace(SANDWICH, connection=connection, bolt=Bolt(*ends, 8e8))
    f, values = np.linspace(3e4, 1e6, 50), stack.parameters()
    names = list(values)
    _, slopes = stack.jacobian(f, names)
    assert "bolt.stiffness" in names
    for name, slope in zip(names, slopes, strict=True):
        step = 1e-5 * abs(values[name])
        up, down = (np.log(stack.replace({name: values[name] + sign * step}).impedance(f)) for sign in (1, -1))
        np.testing.assert_allclose((up - down) / (2 * step), slope, atol=2e-6 * np.abs(slope).max())


def test_a_bolt_without_one_of_its_layers_does_not_act_and_one_without_stiffness_is_refused() -> None:
    cut = replace(SANDWICH, layers=SANDWICH.layers[:-1])
    np.testing.assert_array_equal(cut.impedance(F), replace(cut, bolt=None).impedance(F))
    with pytest.raises(StackError, match="bolt: stiffness is 0"):
        Bolt("tail", "head", 0.0)
