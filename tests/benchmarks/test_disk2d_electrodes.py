"""Whether the mass of the electrodes explains the small eps11S that `disk2d` finds for the disk of 20 by 2 mm."""

from dataclasses import replace
from math import ceil

import numpy as np
import pytest
import scipy.sparse as sp
from built_disk import BuiltDisk, RingMass
from cross_section import Ring

from pzctl.drivers.recordings import read_recording
from pzctl.fitters.disk.two_d import disk2d
from pzctl.fitters.interface import FitTask
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.full import FullDisk, Shape
from pzctl.models.disk2d.line_elements import LineElements
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.disk2d.reduced import ReducedDisk
from pzctl.models.materials import find

from .test_disk2d_figures import build

pytestmark = pytest.mark.timeout(1800)
DENSITY, THICKNESS = 7956.0, 2.013e-3
SILVER = 10490.0


def loaded(full, ratio, share):
    """Return the mesh for this D/t with mass all over both faces, `share` of that of the ceramic."""
    over_r, along_z = LineElements(np.linspace(0, 1, ceil(ratio) + 1), 7).integral(0, 0, lambda x: x), 9

    def face(nodes, columns):
        return sp.kron(nodes, sp.coo_array(([1.0], ([columns - 1], [columns - 1])), shape=(columns, columns)))

    still = full.size + 1 - full.matrices.moving
    mass = sp.block_diag([face(over_r[1:, 1:], along_z), face(over_r, along_z - 1), sp.csr_array((still, still))])
    return FullDisk(replace(full.matrices, mass=sp.csr_array(full.matrices.mass + share * mass)))


def reduced_with(full, reduced):
    """Return the shapes of a reduced disk with another mass; the fit adds missing shapes by the residual."""
    values, turn = np.linalg.eigh(reduced.u.T @ (full.matrices.mass[: full.size, : full.size] @ reduced.u))
    return ReducedDisk.of(full, reduced.u @ (turn / np.sqrt(values)), reduced.p)


def test_mass_of_the_electrodes_does_not_explain_the_permittivity(recordings, monkeypatch):
    pzt = Tensor6mm(*(find("PZT-5A").values[name].value for name in CONSTANTS))
    constants, f, share = np.array([getattr(pzt, name) for name in CONSTANTS]), np.array([0.5e6, 0.9e6]), 0.02
    bare, shape = FullDisk.of(2), Shape(THICKNESS, THICKNESS, DENSITY)
    each = share * DENSITY * THICKNESS / 2 * np.pi * THICKNESS**2
    rings = tuple(RingMass(Ring(side, 0.0, 1.0), each) for side in ("back", "front"))
    section = BuiltDisk(pzt, THICKNESS, THICKNESS, DENSITY, masses=rings).impedance(f)
    heavy = loaded(bare, 2, share).capacitance(shape, constants, f)
    np.testing.assert_allclose(2j * np.pi * f * heavy * section, 1, atol=1e-9)
    assert np.abs(heavy / bare.capacitance(shape, constants, f) - 1).max() > 0.05

    sweep = read_recording(recordings / "disk-20x2" / "thickness-mode.csv")
    few = replace(sweep, frequency=sweep.frequency[::4], impedance=sweep.impedance[::4])
    task = FitTask(build(20e-3, pzt, DENSITY, THICKNESS), {"disk": (few,)})
    made = disk2d.reduced_disk
    found = []
    for um in (0.0, 5.0, 15.0):
        share = SILVER * um * 1e-6 / (DENSITY * THICKNESS / 2)

        def with_mass(ratio, say, electrode=1.0, share=share):
            full, reduced = made(ratio, say, electrode)
            heavy = loaded(full, ratio, share)
            return heavy, reduced_with(heavy, reduced)

        monkeypatch.setattr(disk2d, "reduced_disk", with_mass)
        result = disk2d.Disk2DFitter().fit(task)
        rms, eps = result.rms_log_error, result.constants["disk.eps11S"]
        found.append((rms, eps.re))
        print(f"\nsilver of {um:g} um: {100 * rms:.2f} % left, eps11S {1e9 * eps.re:.2f}({1e9 * eps.u_re:.2f}) nF/m")
    assert found[0][0] < found[1][0] < found[2][0]
    assert found[0][1] > found[1][1] > found[2][1]
