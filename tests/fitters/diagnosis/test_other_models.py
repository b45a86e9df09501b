"""Diagnosis of models that are no stack: a disk's radial modes, solved by finite elements, and a circuit."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from complex_ceramic import TENSOR
from disk_skfem import SkfemDisk

from pzctl.fitters.diagnosis.diagnose import diagnose, fitter_to_diagnose
from pzctl.fitters.disk.radial import RadialLeastSquares
from pzctl.fitters.interface import FitTask, TaskError
from pzctl.fitters.layered.bvd import ButterworthVanDyke
from pzctl.models.base.arrays import Frequencies, Impedances
from pzctl.models.build import Build
from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.constants.causal import continued
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep import Sweep

SIZES = (10.0, 0.25, 7700.0)  # mm, mm, kg/m3
LEAD = 2e-7  # H
CONSIDERED = ("lead-inductance", "cable", "series-resistance")
"""Effects similar to a lead."""


@pytest.fixture(scope="module")
def radial_modes() -> tuple[Frequencies, Impedances]:
    f = np.linspace(120e3, 860e3, 61)
    return f, solved(SIZES, f)


def solved(sizes: tuple[float, float, float], f: Frequencies) -> Impedances:
    """Return Z of a disk of finite thickness, by a package that shares no code with the project's models."""
    law = CausalConstantQ(220e3)
    over = np.array([continued(law, complex(getattr(TENSOR, name)), f)[0] for name in CONSTANTS]).T
    diameter, thickness, density = sizes
    disk = SkfemDisk(diameter / 2e3, thickness / 1e3, 1)
    return 1 / (2j * np.pi * f * disk.capacitance(over, density, f))


def recorded(f: Frequencies, Z: Impedances, seed: int, noise: float = 2e-4) -> Sweep:
    rng = np.random.default_rng(seed)
    return Sweep(f, Z * np.exp(noise * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))))


def test_a_lead_on_a_radial_disk_is_named_with_its_size(
    radial_modes: tuple[Frequencies, Impedances], disk_build: Callable[..., Build]
) -> None:
    f, Z = radial_modes
    build = disk_build("test ceramic", SIZES, (0.0, 0.0, 0.0))

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

    nothing = diagnose(seen(0.0), ("lead-inductance",), fitter=RadialLeastSquares())
    assert (nothing.verdict, nothing.findings) == ("no-mismatch", ())


def test_what_thin_plate_theory_neglects_is_no_dispersion_of_losses(disk_build: Callable[..., Build]) -> None:
    # an exponent of -0.006 was named with 0.94: without any errors it fits best, and so counted in full
    f, sizes = np.linspace(120e3, 650e3, 221), (10.0, 10.0 / 30, 7700.0)
    build = disk_build("test ceramic", sizes, (0.0, 0.0, 0.0))
    sweep = recorded(f, solved(sizes, f), 4, noise=1e-4)
    found = diagnose(FitTask(build, {"disk": (sweep,)}), ("loss-dispersion",), fitter=RadialLeastSquares())
    assert (found.verdict, found.findings) == ("no-mismatch", ())


def test_a_lead_on_a_device_of_unknown_structure_is_named_and_its_circuit_recovered() -> None:
    f = np.linspace(0.6e6, 1.6e6, 101)
    circuit = Lumped(1e-9, (Branch.from_resonance(1e6, 80, 1.5e-10),), tan_delta=0.01)
    # 0.5 uH in so narrow a band are a long lead or a short cable
    for wire, verdict, effects in ((5e-7, "explained", {"lead-inductance", "cable"}), (0.0, "no-mismatch", set())):
        task = FitTask(None, {"probe": (recorded(f, replace(circuit, L=wire).impedance(f), 3),)})
        found = diagnose(task, CONSIDERED, fitter=ButterworthVanDyke())
        assert found.verdict == verdict
        assert len(found.findings) == min(len(effects), 1)
        assert {name for one in found.findings for name in (one.effect, *(o.effect for o in one.same_as))} == effects
        constants = found.final.constants
        assert [constants[name].unit for name in ("C0", "branch1.R", "branch1.L")] == ["F", "ohm", "H"]
        for name in ("C0", "branch1.L", "branch1.C"):
            assert abs(constants[name].re - circuit.parameters()[name]) < 4 * (constants[name].u_re or 0.0), name


def test_what_acts_inside_a_stack_is_refused_for_another_model() -> None:
    with pytest.raises(TaskError, match=r"acts in the layers of a stack.* can have cable, electrode-sheet, lead-"):
        diagnose(FitTask(None, {}), ("electrode-mass",), fitter=ButterworthVanDyke())
    known = "mason, stack2d, radial, disk, disk2d and bvd"
    with pytest.raises(TaskError, match=rf"'sherrit-radial' cannot be diagnosed.* {known}"):
        fitter_to_diagnose("sherrit-radial")
    assert fitter_to_diagnose("mason") is None
