"""Broadened recordings: the analytic continuation of resonances, and disks that are damped alike."""

from functools import lru_cache

import complex_ceramic
import numpy as np
import pytest

from pzctl.fitters.disk.two_d.broadened import Broadening
from pzctl.fitters.disk.two_d.reduced_disk_cache import loadable_disk, reduced_disk
from pzctl.fitters.engine.recording import Recording
from pzctl.models.base.face_loads import Dot
from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.stack import CONSTANT
from pzctl.models.sweep import Sweep

RATIO = 4.0
F = np.linspace(0.7e6, 2.9e6, 401)
NOISE = 2e-4

pytestmark = pytest.mark.usefixtures("own_cache")


@lru_cache(maxsize=4)
def disk(damping: float = 0.0) -> Disk2D:
    reduced = reduced_disk(RATIO, lambda _: None)[1]
    sizes = (np.pi * (RATIO / 2 * 1e-3) ** 2, 1e-3, 7700.0)
    return Disk2D("disk", complex_ceramic.TENSOR, *sizes, reduced, CONSTANT, damping=damping)


def recorded(device, f=F) -> Recording:
    rng = np.random.default_rng(0)
    noise = NOISE * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
    return Recording("disk", Sweep(f, device.impedance(f) * np.exp(noise)), device, np.full(f.size, NOISE))


@pytest.mark.parametrize("damping", [0.0125, 0.1])
def test_a_broadened_recording_is_that_of_a_device_with_more_loss(damping):
    f = np.linspace(0.7e6, 1.3e6, 1201)
    resonances, Q = ((0.9e6, 1.5e-10), (1.05e6, 1e-10)), 250
    circuit = Lumped(1e-9, tuple(Branch.from_resonance(at, Q, C) for at, C in resonances))
    seen = Broadening.of(recorded(circuit, f)).by(damping, 1201).sweep
    lower = seen.frequency * (1 - 0.5j * damping)
    C = 1e-9 + sum(C1 / (1 - (lower / at) ** 2 + 1j * lower / at / Q) for at, C1 in resonances)
    off = np.abs(1 / (2j * np.pi * seen.frequency * seen.impedance) / C - 1)
    assert np.median(off) < NOISE
    assert np.max(off) < 2e-3


def test_a_broadened_recording_of_a_disk_is_that_of_a_damped_one():
    broad = Broadening.of(recorded(disk()))
    for damping in (0.025, 0.1, 0.2):
        seen = broad.by(damping, F.size).sweep
        off = np.abs(np.log(disk(damping).impedance(seen.frequency) / seen.impedance))
        assert np.median(off) < 2 * NOISE
        assert np.max(off) < 5e-3
    assert broad.by(0.2, F.size).sweep.frequency.size < F.size / 2
    assert np.array_equal(broad.by(0.0, F.size).sweep.impedance, broad.recording.sweep.impedance)


def test_a_damped_disk_has_the_derivatives_of_damped_constants():
    damped, f = disk(0.2), F[::40]
    names = [f"disk.{name}.{part}" for name in ("c13E", "e33", "eps11S") for part in ("re", "im")]
    own = damped.parameters()
    sizes = [abs(complex(own[name[:-2] + "re"], own[name[:-2] + "im"])) for name in names]
    _, slopes = damped.jacobian(f, names)
    told = slopes * np.array(sizes)[:, None]
    for name, size, slope in zip(names, sizes, told, strict=True):
        up, down = (np.log(damped.replace({name: own[name] + side * size}).impedance(f)) for side in (1e-4, -1e-4))
        np.testing.assert_allclose(slope, (up - down) / 2e-4, rtol=2e-3, atol=5e-4 * np.abs(told).max(), err_msg=name)


@pytest.mark.long
def test_a_damped_disk_with_a_dot_is_the_broadened_one():
    loadable = loadable_disk(RATIO, lambda _: None)
    dot = Dot(fraction=0.01, mass=2.0, impedance=2e7, speed=2800.0, dome=0.3, q=50.0)
    plain, damped = (
        Disk2D(**{**vars(disk(damping)), "loadable": lambda: loadable, "_known": []}).with_load("face:front", dot)
        for damping in (0.0, 0.1)
    )
    seen = Broadening.of(recorded(plain)).by(0.1, F.size).sweep
    off = np.abs(np.log(damped.impedance(seen.frequency) / seen.impedance))
    without = np.abs(np.log(disk(0.1).impedance(seen.frequency) / seen.impedance))
    assert np.median(off) < 3 * NOISE < 0.1 * np.median(without)


@pytest.mark.long
def test_a_disk_with_loadable_faces_is_cached():
    first = loadable_disk(RATIO, lambda _: None)
    said: list[str] = []
    again = loadable_disk(RATIO, said.append)
    assert not said
    for one, other in zip(first.parts, again.parts, strict=True):
        np.testing.assert_array_equal(one.stiffness, other.stiffness)
        np.testing.assert_array_equal(one.axial, other.axial)
