"""What moves no constant by its uncertainty and no curve by 0.1 % is a remark with its size, not a mismatch."""

import numpy as np
import pytest

import pzctl
from pzctl.daemon.files.builds.build_file import THESIS_BUILD
from pzctl.daemon.report.analysis import DiagnosisAnalysis
from pzctl.models.base.model import Model
from pzctl.models.effects import Device, lead_inductance, thickness_variation

F = np.linspace(2e6, 6e6, 101)


def diagnosed(
    device: Model,
    accuracy: float,
    effects: list[str],
    step: str = "disk",
    scatter: float = 1e-6,
) -> DiagnosisAnalysis:
    """Return the diagnosis of a recording by an analyzer that errs by its accuracy, with noise."""
    noise = np.random.default_rng(1).normal(scale=scatter, size=(2, F.size))
    gain = accuracy * np.log(F / 3.5e6)
    Z = device.impedance(F) * np.exp(gain + noise[0] + 1j * noise[1])
    sweep = pzctl.Sweep(F, Z, settings={"accuracy": accuracy})
    return pzctl.diagnose(THESIS_BUILD, {step: sweep}, effects=effects)


def with_lead(inductance: float, accuracy: float) -> DiagnosisAnalysis:
    """Return the diagnosis of a disk with a lead (H)."""
    lead = lead_inductance.EFFECT
    device = Device(pzctl.model(THESIS_BUILD, "disk")).with_effect(lead, "terminals", {"inductance": inductance})
    return diagnosed(device, accuracy, ["lead-inductance", "series-resistance"])


def uneven(step: str, variance: float, scatter: float = 1e-6) -> DiagnosisAnalysis:
    """Return the diagnosis of a step whose last layer has this variance of its relative thickness."""
    where, model = f"layer:{step}", pzctl.model(THESIS_BUILD, step)
    device = Device(model).with_effect(thickness_variation.EFFECT, where, {"variance": variance})
    return diagnosed(device, 8e-4, ["thickness-variation"], step, scatter)


@pytest.mark.long
def test_an_effect_that_changes_nothing_is_a_remark_with_its_size() -> None:
    diagnosis = uneven("ml1", 5e-7, scatter=5e-6)
    assert (diagnosis.verdict, diagnosis.findings) == ("no-mismatch", ())
    assert [one.effect for one in diagnosis.result.remarks] == ["thickness-variation"]
    said = " ".join(str(diagnosis).split())
    assert said.startswith("Model and recording agree to within the noise")
    assert "remark, no mismatch: layer:" in said
    assert "layer:ml1" in said, "so little is not placed: all places are told"
    assert "% (rms) and no constant by its uncertainty" in said


def test_faces_of_a_disk_as_parallel_as_those_of_any_are_not_even_a_remark() -> None:
    diagnosis = uneven("disk", 4e-8)
    assert (diagnosis.verdict, diagnosis.findings, diagnosis.result.remarks) == ("no-mismatch", (), ())


@pytest.mark.long
def test_a_lead_as_short_as_the_usual_residual_of_a_fixture_is_no_finding() -> None:
    """Two explanations are the best in turn here, and yet the search ends."""
    diagnosis = with_lead(1e-9, 1e-5)
    assert (diagnosis.verdict, diagnosis.findings, diagnosis.result.remarks) == ("no-mismatch", (), ())
    assert "differ" not in str(diagnosis)


@pytest.mark.long
def test_errors_that_a_verdict_relies_on_are_told_and_drawn() -> None:
    noise, accuracy = 1e-6, 8e-4
    diagnosis = with_lead(2e-8, accuracy)
    assert [one.effect for one in diagnosis.findings] == ["lead-inductance"]
    assert diagnosis.result.says[0].endswith("the usual errors of instrument and device explain the whole difference.")
    assert diagnosis.result.says[-1].startswith("The fit leaves 0.")
    (curve,) = diagnosis.result.after
    assert curve.explained is not None
    assert np.std(np.log(curve.fitted / curve.measured)) > 0.1 * accuracy
    assert np.std(np.log(curve.explained / curve.measured)) < 2 * np.sqrt(2) * noise
    remaining = diagnosis.result.remaining
    assert remaining is not None
    assert remaining.noise is not None
    assert remaining.noise < 2 * np.sqrt(2) * noise < 0.1 * accuracy < remaining.total
