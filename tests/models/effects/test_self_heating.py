"""A sweep that warms the device, compared with its differential equation, integrated point by point."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from pzctl.models.effects import Conditions, Device, find_effect
from pzctl.models.stack import AIR, Elastic, Piezo, Stack

DISK = Piezo("disk", 0.5e-3, 7700.0, 1.444e11 * (1 + 1j / 80), 1.98e9 + 1e7j, 8.09e-9 * (1 - 0.017j))
BARE = Stack((DISK,), AIR, AIR, np.pi * 5e-3**2)
GLUED = replace(BARE, layers=(DISK, Elastic("glue1", 10e-6, 2.9e6, 2550.0, 30.0)))
F = np.linspace(3.4e6, 4.6e6, 801)
F.flags.writeable = False
SOURCE = 25.0


def swept(direction: str = "up", level: float = 0.5, stack: Stack = BARE, **values: float) -> Device:
    device = Device(stack, conditions=Conditions(direction, level, began=2.0, length=0.7))
    given = {"stiffness": 0.0, "permittivity": 0.0, "time": 0.4, "source": SOURCE, **values}
    return device.with_effect(find_effect("self-heating"), "layer:disk", given)


def warmer(heat: float, stiffness: float, permittivity: float) -> Stack:
    hot = replace(DISK, c33D=DISK.c33D * (1 + stiffness * heat), eps33S=DISK.eps33S * (1 + permittivity * heat))
    return replace(BARE, layers=(hot,))


@pytest.mark.parametrize("direction", ["up", "down"])
def test_the_device_is_as_warm_as_its_differential_equation_says(direction: str) -> None:
    """Stiffness changes by up to half a per cent, so that the heat changes the power that makes it."""
    level, time, sizes = 1.0, 0.4, (-3.0, 8.0)
    Z = swept(direction, level, stiffness=sizes[0], permittivity=sizes[1], time=time).impedance(F)
    ends = (F[0], F[-1]) if direction == "up" else (F[-1], F[0])

    def warming(t: float, heat: np.ndarray) -> float:
        f = np.array([ends[0] + (ends[1] - ends[0]) * t / 0.7])
        z = complex(warmer(heat[0], *sizes).impedance(f)[0])
        return (level**2 * z.real / abs(z + SOURCE) ** 2 - heat[0]) / time

    times = np.linspace(0, 0.7, F.size)
    heat = solve_ivp(warming, (0, 0.7), [0.0], "DOP853", times, rtol=1e-9, atol=1e-12).y[0]
    frequencies, heat = (F, heat) if direction == "up" else (F, heat[::-1])
    expected = [warmer(T, *sizes).impedance(f[None])[0] for f, T in zip(frequencies, heat, strict=True)]
    assert np.max(np.abs(np.array(expected) / BARE.impedance(F) - 1)) > 0.3
    np.testing.assert_allclose(Z, expected, rtol=2e-4)


def peak(device: Device) -> float:
    """Return the frequency of the parallel resonance, from a parabola through the three largest values."""
    R = device.impedance(F).real
    k = int(np.argmax(R))
    a, b, c = R[k - 1 : k + 2]
    return F[k] + 0.5 * (a - c) / (a - 2 * b + c) * (F[1] - F[0])


def test_upwards_the_parallel_resonance_is_that_of_a_warm_device_and_four_times_as_far_at_twice_the_level() -> None:
    """The power is largest at the series resonance, which an upward sweep passes before and a downward one after."""
    cold = peak(Device(BARE))
    up, twice, down = (
        peak(swept(direction, level, stiffness=-0.4)) - cold
        for direction, level in (("up", 0.25), ("up", 0.5), ("down", 0.5))
    )
    assert up < 0
    assert twice / up == pytest.approx(4, rel=0.01)
    assert 0 < down / twice < 0.25


def test_nothing_changes_without_heat_or_before_the_device_can_become_warm() -> None:
    Z = BARE.impedance(F)
    assert np.array_equal(swept(stiffness=0.0).impedance(F), Device(BARE).impedance(F))
    slow, slower = (np.max(np.abs(swept(stiffness=-0.4, time=time).impedance(F) / Z - 1)) for time in (10.0, 100.0))
    assert slower == pytest.approx(slow / 10, rel=0.1)
    late = swept(stiffness=-0.4, level=1e-6).impedance(F)
    np.testing.assert_allclose(late, Z, rtol=1e-10)


@pytest.mark.parametrize("direction", ["up", "down"])
def test_a_fit_has_the_derivatives_of_the_whole_course(direction: str) -> None:
    """Those by constants, which change the heat, too, and those by its own parameters: within 1e-5 of the largest."""
    device = swept(direction, 1.0, GLUED, stiffness=-3.0, permittivity=8.0)
    names = ["disk.c33D.re", "disk.h33.re", "disk.eps33S.im", "disk.thickness", "glue1.z", "area"]
    names += [f"self-heating@layer:disk.{name}" for name in ("stiffness", "permittivity", "time", "source")]
    _, slopes = device.jacobian(F, names)
    for name, row in zip(names, slopes, strict=True):
        value = device.parameters()[name]
        ends = [device.replace({name: value * (1 + step)}).impedance(F) for step in (1e-5, -1e-5)]
        numeric = np.log(ends[0] / ends[1]) / (2e-5 * value)
        assert np.max(np.abs(row - numeric)) < 1e-5 * np.max(np.abs(numeric)), name
