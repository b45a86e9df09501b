"""Disks with a dot of solder against general finite elements, radii from a sixth to all of the thickness.

`python tests/benchmarks/test_disk2d_dots.py` prints what differs, and what finite elements differ with their mesh.
"""

import sys
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from finite_disk_world import SOLDER, FeDisk, FiniteDiskCase, constants_at, drawn

from pzctl.models.base.face_loads import Dot
from pzctl.models.disk2d.dotted import FreeDisk, PlacedDot
from pzctl.models.disk2d.full import Shape
from pzctl.models.disk2d.loadable import trained_for_loads

RADII = (0.15, 0.3, 0.6, 1.0)
"""Of dots, over the thickness."""
CASE = FiniteDiskCase(**{**asdict(drawn(0)), "effect": "local-mass", "diameter": 8e-3, "thickness": 1e-3})


def case_with(radius):
    return replace(CASE, size={"radius": radius * CASE.thickness, "height": 0.25 * CASE.thickness})


def solder(case):
    stiff = SOLDER["stiffness"] * (1 - SOLDER["poisson"]) / (1 + SOLDER["poisson"]) / (1 - 2 * SOLDER["poisson"])
    speed, density = np.sqrt(stiff / SOLDER["density"]), SOLDER["density"]
    part = (case.size["radius"] / (case.diameter / 2)) ** 2
    return Dot(part, density * case.size["height"], density * speed, speed, 0.0, 1 / SOLDER["loss"], SOLDER["poisson"])


def compared(faces, radius, frequency):
    """Return |ln Z| of the reduced disk less that of finite elements, and that of the dot itself, shape (N,)."""
    case = case_with(radius)
    ten = np.array([constants_at(case, f) for f in frequency])
    shape = Shape(case.diameter / 2, case.thickness, case.density)
    made = FreeDisk(faces, shape, ten, frequency, False).with_dots((PlacedDot("face:front", solder(case)),))
    Z = FeDisk(case).impedance(frequency)
    w = 2j * np.pi * frequency
    return np.abs(np.log(w * made.capacitance * Z)), np.abs(np.log(w * made.bare_capacitance * Z))


@pytest.fixture(scope="module")
def faces():
    return trained_for_loads(CASE.diameter / CASE.thickness)


@pytest.mark.timeout(600)
@pytest.mark.parametrize("radius", RADII)
def test_a_dot_of_solder_equals_general_finite_elements(faces, radius):
    off, dot = compared(faces, radius, CASE.frequency[::10])
    assert np.median(off) < (1e-3 if radius < 1 else 4e-3)
    assert np.sqrt(np.mean(off**2)) < 0.03 * np.sqrt(np.mean(dot**2))


if __name__ == "__main__":
    own, every = trained_for_loads(CASE.diameter / CASE.thickness), CASE.frequency[::4]
    for size in RADII:
        off, dot = compared(own, size, every)
        meshes = [FeDisk(case_with(size), order).impedance(every) for order in (7, 9)]
        mesh = np.abs(np.log(meshes[0] / meshes[1]))
        for name, one in (("model", off), ("dot", dot), ("mesh", mesh)):
            rms = np.sqrt(np.mean(one**2))
            print(f"{size:4g} {name:6s} median {np.median(one):.1e} rms {rms:.1e} max {one.max():.1e}", flush=True)
