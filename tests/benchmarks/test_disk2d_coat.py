"""Electrodes and dead layers of a disk compared with layers of finite thickness, scikit-fem.

`models/disk2d` has both as thin layers: what it leaves is therefore stated as a part of what they change. Faces that
are not alike also excite antisymmetric motion; what is left without it is its share.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from finite_disk_world import SILVER, FeDisk, constants_at, drawn, unpoled_of

from pzctl.models.base.face_loads import Coat, DeadLayer
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.odd_training import trained_odd
from pzctl.models.disk2d.training import trained

ELECTRODES, DEAD = 407, 403


def silver(thickness, other):
    """Return the same silver as a coat."""
    nu, E = SILVER["poisson"], SILVER["stiffness"]
    c33 = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    mass = SILVER["density"] * thickness
    return Coat(mass, float(np.sqrt(c33 / SILVER["density"])), 1 / SILVER["loss"], nu, SILVER["density"], other)


def shares(case, where, load, truth, plain, f):
    """Return what is left with this load, and with the mean of both faces, over what it changes; rms of ln Z."""
    ratio, tensor = case.diameter / case.thickness, Tensor6mm(*constants_at(case, case.centre))
    area, odd = np.pi * case.diameter**2 / 4, trained_odd(ratio)
    bare = Disk2D("disk", tensor, area, case.thickness, case.density, trained(ratio), odd=lambda: odd)
    found = bare.with_load(where, load)
    change, left, mean = (
        float(np.sqrt(np.mean(np.abs(np.log(one / truth)) ** 2)))
        for one in (plain, found.impedance(f), replace(found, odd=None, _known=[]).impedance(f))
    )
    return change, left / change, mean / change


@pytest.mark.timeout(600)
@pytest.mark.parametrize(("height", "other"), [(1e-6, 1.0), (4e-6, 1.0), (8e-6, 1.0), (4e-6, 0.6), (1.2e-5, 0.6)])
def test_a_coat_equals_thin_silver(height, other, capsys):
    case = replace(drawn(ELECTRODES), law="constant")
    f = case.frequency[::10]
    plain = FeDisk(replace(case, effect="", size={})).impedance(f)
    truth = FeDisk(replace(case, size={"height": height, "other": other})).impedance(f)
    change, left, mean = shares(case, "face:front", silver(height, other), truth, plain, f)
    with capsys.disabled():
        print(
            f"\n{1e6 * height:.0f} and {1e6 * height * other:.1f} um of silver on {1e3 * case.thickness:.2f} mm: "
            f"{100 * change:.2g} % of ln Z, of which a coat leaves {100 * left:.2g} %, both alike {100 * mean:.2g} %",
            end="",
        )
    assert left < 0.01


@pytest.mark.timeout(600)
@pytest.mark.parametrize("depth", [3e-6, 1.25e-5, 3e-5])
def test_a_dead_layer_equals_unpoled_ceramic_under_one_face(depth, capsys):
    case = replace(drawn(DEAD), law="constant")
    f = case.frequency[::10]
    plain = FeDisk(replace(case, effect="", size={})).impedance(f)
    truth = FeDisk(replace(case, size={"depth": depth})).impedance(f)
    live = constants_at(case, case.centre)
    dead, c33D = unpoled_of(live).real, (live[3] + live[6] ** 2 / live[9]).real
    load = DeadLayer(depth, stiffness=dead[0] / c33D, permittivity=dead[8] / live[9].real)
    change, left, mean = shares(case, "layer:disk", load, truth, plain, f)
    with capsys.disabled():
        print(
            f"\n{1e6 * depth:.3g} um dead of {1e3 * case.thickness:.2f} mm: {100 * change:.2g} % of ln Z, of which the "
            f"model leaves {100 * left:.2g} %, on both faces alike {100 * mean:.2g} %",
            end="",
        )
    assert left < 0.3
