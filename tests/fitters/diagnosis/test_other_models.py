"""Diagnosis of models that are no stack; tests/benchmarks/test_radial_diagnosis.py has a lead on a radial disk."""

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from radial_skfem import recorded, solved

from pzctl.drivers.recordings import read_recording
from pzctl.fitters.diagnosis.diagnose import diagnose, fitter_to_diagnose
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.disk.radial import RadialLeastSquares
from pzctl.fitters.engine.objective import Objective
from pzctl.fitters.engine.recording import Posterior
from pzctl.fitters.error_model.marginal import Marginal
from pzctl.fitters.interface import FitTask, TaskError
from pzctl.fitters.layered.bvd import ButterworthVanDyke
from pzctl.models.build import Build
from pzctl.models.circuits.lumped import Branch, Lumped

CONSIDERED = ("lead-inductance", "cable", "series-resistance")
"""Effects similar to a lead."""


@pytest.mark.long
def test_what_thin_plate_theory_neglects_is_no_dispersion_of_losses(disk_build: Callable[..., Build]) -> None:
    # an exponent of -0.006 was named with 0.94: without any errors it fits best, and so counted in full
    f, sizes = np.linspace(120e3, 650e3, 221), (10.0, 10.0 / 30, 7700.0)
    build = disk_build("test ceramic", sizes, (0.0, 0.0, 0.0))
    sweep = recorded(f, solved(sizes, f), 4, noise=1e-4)
    found = diagnose(FitTask(build, {"disk": (sweep,)}), ("loss-dispersion",), fitter=RadialLeastSquares())
    assert (found.verdict, found.findings) == ("no-mismatch", ())


@pytest.mark.long
def test_what_errors_explain_of_a_real_disk_is_no_dispersion(
    disk_build: Callable[..., Build], recordings: Path
) -> None:
    """One of many hypotheses was continued with all points, gained 800 nats by errors of other sizes, and was named."""
    sweeps = tuple(read_recording(recordings / "disk-35x2" / f"radial-mode-{k}.csv") for k in (1, 2))
    build = disk_build("Pz27", (35.0, 2.0, 7743.0), (0.0, 0.005, 0.0))
    considered = ("sweep-lag", "dielectric-dispersion", "leakage", "series-resistance", "lead-inductance")
    found = diagnose(FitTask(build, {"disk": sweeps}), considered, fitter=RadialLeastSquares())
    assert "dielectric-dispersion" not in {one.effect for one in found.findings}
    assert found.remaining is not None
    assert found.remaining.total < 0.05, "constants of another density missed the recording by a fifth"


@pytest.mark.long
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
    with pytest.raises(TaskError, match=r"acts in the layers of a stack.* can have cable, electrode-sheet, fixture-"):
        diagnose(FitTask(None, {}), ("electrode-mass",), fitter=ButterworthVanDyke())
    known = "mason, stack2d, radial, disk, disk2d and bvd"
    with pytest.raises(TaskError, match=rf"'sherrit-radial' cannot be diagnosed.* {known}"):
        fitter_to_diagnose("sherrit-radial")
    assert fitter_to_diagnose("mason") is None


def test_a_diagnosis_keeps_what_its_model_knows_of_several_coordinates_together() -> None:
    # the plane constants and losses of a disk are known so; refits had dropped it
    f = np.linspace(0.6e6, 1.6e6, 101)
    circuit = Lumped(1e-9, (Branch.from_resonance(1e6, 80, 1.5e-10),), tan_delta=0.01)
    task = FitTask(None, {"probe": (recorded(f, circuit.impedance(f), 3),)})
    found = ButterworthVanDyke().fitted_model(task)
    fitted = found.descent.objective
    free = fitted.coordinates.free
    known = Posterior(free, found.descent.x + 1.0, np.eye(len(free)))
    objective = Objective(fitted.recordings, fitted.coordinates, (*fitted.all_priors, known))
    problem = Problem.of_model(replace(found, descent=replace(found.descent, objective=objective)))
    searched = Marginal.of(problem.objective((), problem.values))
    assert searched.against(found.descent.x) == pytest.approx(
        Marginal.of(fitted).against(found.descent.x) + len(free), rel=1e-6
    )
