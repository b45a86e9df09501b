"""A rough start of a disk moves to its free plate's minimum in a few steps, or stays unchanged."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.fitters.engine.refine import refined
from pzctl.fitters.engine.start import disk_starts, distinct
from pzctl.models.stack import VACUUM, Piezo
from pzctl.models.sweep import Sweep

DISK = Piezo("disk", 0.5e-3, 7700.0, 1.5e11 * (1 + 0.01j), 2e9 * (1 + 0.004j), 7.5e-9 * (1 - 0.012j))
PLATE = (DISK.thickness, DISK.density, 2e-4)
F = np.linspace(0.5e6, 15.5e6, 801)


def recorded(noise: float) -> Sweep:
    rng = np.random.default_rng(4)
    error = noise * (rng.standard_normal(F.size) + 1j * rng.standard_normal(F.size))
    return Sweep(F, (VACUUM | DISK | VACUUM).with_area(2e-4).impedance(F) * np.exp(error))


@pytest.mark.parametrize("noise", [0.0, 2e-4])
def test_the_constants_of_a_free_plate_are_found(noise: float) -> None:
    sweep = recorded(noise)
    (start,) = distinct(disk_starts(sweep, *PLATE), 1)
    far = replace(start, c33D=0.97 * start.c33D.real * (1 + 0.08j), h33=1.2 * start.h33, eps33S=0.8 * start.eps33S)
    for begun in (start, far):
        found = refined(begun, sweep, *PLATE)
        for name in ("c33D", "h33", "eps33S"):
            true, rough, fine = getattr(DISK, name), getattr(begun, name), getattr(found, name)
            assert abs(fine / true - 1) < 1e-9 + 3 * noise < abs(rough / true - 1)


def test_without_a_free_plate_the_start_is_unchanged() -> None:
    sweep = recorded(2e-4)
    (start,) = distinct(disk_starts(sweep, *PLATE), 1)
    wire = Sweep(F, 1.0 + 1e-7j * F)
    assert refined(start, wire, *PLATE) is start
