"""Learned laws of a sweep, compared with the plain device at each point: what it is at that time, or at that strain."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from pzctl.models.effects import Conditions, Device
from pzctl.models.effects.learned.corrections import Place
from pzctl.models.effects.learned.laws import Law
from pzctl.models.effects.learned.sweep_laws import IN_STRAIN, IN_TIME, SweepLaw, swept_places
from pzctl.models.stack import AIR, Elastic, Piezo, Stack

F = np.linspace(3.4e6, 4.6e6, 25)
AREA = np.pi * 5e-3**2
DISK = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 1e7j, 8.09e-9 * (1 - 0.017j))
BARE = Stack((DISK,), AIR, AIR, AREA)
DRIFT, SETTLING = IN_TIME
(SOFTENING,) = IN_STRAIN
CONSTANT = {"stiffness": "c33D", "permittivity": "eps33S", "coupling": "h33"}


def swept(quantity: str, law: Law, conditions: Conditions, **values: float) -> Device:
    """Return the disk as recorded by a sweep, with one of its constants changing."""
    place = Place("layer:disk", quantity)
    return Device(BARE, conditions=conditions).with_effect(SweepLaw(place, law, BARE), place.where, values)


def with_factor(quantity: str, factor: complex) -> Stack:
    value = getattr(DISK, CONSTANT[quantity]) * factor
    return BARE.replace({f"disk.{CONSTANT[quantity]}.re": value.real, f"disk.{CONSTANT[quantity]}.im": value.imag})


@pytest.mark.parametrize("quantity", CONSTANT)
@pytest.mark.parametrize(
    ("law", "values", "change"),
    [
        (DRIFT, {"size": -4e-3}, lambda t: -4e-3 * t),
        (SETTLING, {"size": 4e-3, "time": 0.5}, lambda t: 4e-3 * (1 - np.exp(-t / 0.5))),
    ],
    ids=["drift", "settling"],
)
def test_every_point_is_that_of_the_device_at_its_time(
    quantity: str, law: Law, values: dict[str, float], change: Callable[[float], float]
) -> None:
    """The second sweep, downwards, begins one and a half durations after the first one and takes half as long."""
    seen = swept(quantity, law, Conditions("down", began=1.5, length=0.5), **values).impedance(F)
    times = 1.5 + 0.5 * np.linspace(1, 0, F.size)
    expected = [with_factor(quantity, 1 + change(t)).impedance(f[None])[0] for t, f in zip(times, F, strict=True)]
    np.testing.assert_allclose(seen, expected, rtol=1e-10)


@pytest.mark.parametrize("power", [0.7, 1.0, 2.0])
def test_a_softening_follows_a_power_of_the_strain_that_it_leaves(power: float) -> None:
    """Compared with a root finder at each point, from the disk's own field."""
    size, r, level = 4e-3, 0.4, 0.5
    seen = swept(
        "stiffness", SOFTENING, Conditions(level_V=level), size=size, exponent=power, loss=r, source=25.0
    ).impedance(F)

    def at(f: np.ndarray, strain: float) -> tuple[complex, float]:
        z = complex(with_factor("stiffness", 1 - size * (strain / 1e-5) ** power * (1 - 1j * r)).impedance(f)[0])
        clamped = DISK.thickness / (2j * np.pi * f[0] * DISK.eps33S * AREA)
        current = np.sqrt(2) * level / abs(z + 25)
        return z, current * abs(z - clamped) / (abs(DISK.h33) * DISK.thickness)

    expected = []
    for k in range(F.size):
        one = F[k : k + 1]
        expected.append(at(one, brentq(lambda s, one=one: at(one, s)[1] - s, 0.0, 1e-4, xtol=1e-16))[0])
    np.testing.assert_allclose(seen, expected, rtol=1e-8)


@pytest.mark.parametrize(
    ("quantity", "law", "values"),
    [
        ("permittivity", DRIFT, {"size": -4e-3}),
        ("stiffness", SOFTENING, {"size": 2e-3, "exponent": 1.5, "loss": 0.4, "source": 25.0}),
    ],
    ids=["drift", "softening"],
)
def test_a_fit_has_the_derivatives_of_a_device_whose_constant_changes(
    quantity: str, law: Law, values: dict[str, float]
) -> None:
    device, step = swept(quantity, law, Conditions(), **values), 1e-6
    names = ["disk.c33D.re", "disk.h33.re", "disk.eps33S.im", "disk.thickness"]
    _, slopes = device.jacobian(F, names)
    for name, row in zip(names, slopes, strict=True):
        value = device.parameters()[name]
        ends = [device.replace({name: value * (1 + one)}).impedance(F) for one in (step, -step)]
        numeric = np.log(ends[0] / ends[1]) / (2 * step * value)
        assert np.max(np.abs(row - numeric)) < 1e-5 * np.max(np.abs(numeric)), name


def test_the_strain_is_known_of_a_single_piezoelectric_layer_only() -> None:
    two = replace(BARE, layers=(DISK, Elastic("glue1", 10e-6, 2.9e6, 2550.0, 30.0), replace(DISK, name="disk2")))
    laws = {law.name for _, law in swept_places(two)}
    assert "drift" in laws
    assert "softening" not in laws
    assert ("layer:disk", "stiffness", "softening") in {
        (place.where, place.quantity, law.name) for place, law in swept_places(BARE)
    }
