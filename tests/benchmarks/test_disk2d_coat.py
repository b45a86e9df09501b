"""Electrodes on a disk: the coat of `models/disk2d/coat.py` compared with silver of finite thickness, scikit-fem.

A coat is first order in its thickness; the error is therefore stated as a part of what the electrodes change.
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).parent))

from finite_disk_world import SILVER, FeDisk, constants_at, drawn

from pzctl.models.base.face_loads import Coat
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.disk2d.training import trained

CASE = 407


def silver(thickness):
    """Return the same silver as a coat."""
    nu, E = SILVER["poisson"], SILVER["stiffness"]
    c33 = E * (1 - nu) / ((1 + nu) * (1 - 2 * nu))
    mass = SILVER["density"] * thickness
    return Coat(mass, float(np.sqrt(c33 / SILVER["density"])), 1 / SILVER["loss"], nu)


@pytest.mark.timeout(600)
def test_a_coat_equals_thin_silver_on_both_faces(capsys):
    case = replace(drawn(CASE), law="constant")
    f = case.frequency[::10]
    tensor = Tensor6mm(*constants_at(case, case.centre))
    area = np.pi * case.diameter**2 / 4
    bare = Disk2D("disk", tensor, area, case.thickness, case.density, trained(case.diameter / case.thickness))
    plain = FeDisk(replace(case, effect="", size={})).impedance(f)
    parts = []
    for height in (1e-6, 2e-6, 4e-6, 8e-6):
        truth = FeDisk(replace(case, size={"height": height, "other": 1.0})).impedance(f)
        found = bare.with_load("face:front", silver(height)).impedance(f)
        only_mass = bare.with_load("face:front", replace(silver(height), speed=0.0)).impedance(f)
        change, left, heavy = (
            float(np.sqrt(np.mean(np.abs(np.log(one / truth)) ** 2))) for one in (plain, found, only_mass)
        )
        parts.append(left / change)
        with capsys.disabled():
            print(
                f"\n{1e6 * height:.0f} um on {1e3 * case.thickness:.2f} mm: {100 * change:.2g} % of ln Z, of which a "
                f"coat leaves {100 * left / change:.2g} %, its mass alone {100 * heavy / change:.2g} %",
                end="",
            )
    assert max(parts) < 0.03
