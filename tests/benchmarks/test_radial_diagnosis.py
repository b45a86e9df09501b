"""A lead on a disk whose radial modes are solved by finite elements is named with its size."""

from dataclasses import replace

import numpy as np
from complex_ceramic import MATERIAL, TENSOR
from disk_build import disk_build
from radial_skfem import recorded, solved

from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.disk.radial import RadialLeastSquares
from pzctl.fitters.interface import FitTask
from pzctl.models.build import Build

SIZES = (10.0, 0.25, 7700.0)  # mm, mm, kg/m3
LEAD = 2e-7  # H
CONSIDERED = ("lead-inductance", "cable", "series-resistance", "stray-capacitance")
"""Effects similar to a lead."""


def described() -> Build:
    """Return the build of the disk, of the tests' own ceramic."""
    build = disk_build(*SIZES)
    constants = {name: value for name, value in MATERIAL.values.items() if name != "density"}
    disk = replace(build.layers[0], material=MATERIAL.name, values={**build.layers[0].values, **constants})
    return replace(build, layers=(disk,))


def test_a_lead_on_a_radial_disk_is_named_with_its_size() -> None:
    f = np.linspace(120e3, 860e3, 81)
    Z, build = solved(SIZES, f), described()

    def seen(inductance: float) -> FitTask:
        return FitTask(build, {"disk": (recorded(f, Z + 2j * np.pi * f * inductance, 1),)})

    found = diagnose(seen(LEAD), CONSIDERED, fitter=RadialLeastSquares())
    (lead,) = found.findings
    assert (found.verdict, lead.where) == ("explained", "terminals")
    # 0.2 uH are a long lead or a short cable, which the radial modes do not tell apart; a wire's resistance that grows
    # with frequency explains nothing beside them, and errors make it a tenth as probable
    alike = {lead.effect, *(other.effect for other in lead.same_as)}
    assert alike == {"lead-inductance", "cable", "series-resistance"}
    size = lead.parameters["inductance"]
    assert abs(size.value - LEAD) < 3 * size.u < 0.5 * LEAD
    s11E = found.final.constants["disk.s11E"]
    assert s11E.unit == "1/Pa"
    assert abs(s11E.re - TENSOR.radial.s11E.real) < 3 * (s11E.u_re or 0.0)

    nothing = diagnose(seen(0.0), CONSIDERED, fitter=RadialLeastSquares())
    assert (nothing.verdict, nothing.findings) == ("no-mismatch", ())
