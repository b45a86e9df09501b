"""Data-quality gates: data issues are found at their place, and sound data pass."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from pzctl.drivers.recordings import read_recording
from pzctl.fitters.diagnosis.data_quality.data_gates import gate
from pzctl.fitters.diagnosis.inference.data_findings import of_the_data, verdict_with
from pzctl.models.sweep import Sweep
from pzctl.sim.blind_cases.device_under_test import random_device
from pzctl.sim.blind_cases.recording_process import SweepSpec, noisy, record
from pzctl.sim.blind_cases.scenario import NOTHING


def sound(seed: int, steps: int = 1, top: float = 3.4, **settings: object) -> Sweep:
    """Return a flawless recording of a device, computed by formulas that the models do not use."""
    rng = np.random.default_rng(seed)
    device = random_device(rng, "x", steps, backed=False)
    f = np.linspace(0.12, top, 801) * device.disk.f0
    spec = SweepSpec(device.steps[-1], f)
    return Sweep(f, noisy(record(device, NOTHING, spec), spec, rng), settings)


def with_factor(sweep: Sweep, factor: object) -> Sweep:
    return replace(sweep, impedance=sweep.impedance * np.asarray(factor))


@pytest.mark.parametrize("seed", range(4))
def test_a_sound_recording_passes_untouched(seed: int) -> None:
    sweep = sound(seed, steps=1 + seed % 2, top=(1.5, 3.4)[seed // 2])
    gated = gate({"disk": (sweep,)})
    (check,) = gated.checks
    assert check.troubles == ()
    assert not check.turned
    assert check.causal_chi2_per_dof == pytest.approx(1, abs=0.25)
    np.testing.assert_array_equal(gated.sweeps["disk"][0].impedance, sweep.impedance)


def test_a_jump_is_found_removed_and_located() -> None:
    sweep, at = sound(5, sweep_seconds=80.1, direction="down"), 600
    after = np.arange(801) >= at
    gated = gate({"disk": (with_factor(sweep, np.where(after, 1.004 + 0.002j, 1.0)),)})
    (jump,) = gated.checks[0].abrupt
    assert jump.kind == "step"
    assert jump.band_Hz == (sweep.frequency[at - 1], sweep.frequency[at])
    assert jump.size == pytest.approx(0.0045, rel=0.1)
    assert jump.seconds == pytest.approx(80.1 * (1 - (at - 1) / 800))
    left = gated.sweeps["disk"][0].impedance / sweep.impedance
    np.testing.assert_allclose(left, 1, atol=3e-4)
    assert verdict_with(gated, "no-mismatch") == "unexplained"
    (finding,) = of_the_data(gated, 1.0, 1.0)
    assert (finding.effect, finding.where) == ("unknown", "any")
    assert "jumps by 0.4" in finding.says


@pytest.mark.parametrize("length", [1, 6])
def test_a_faint_glitch_is_not_a_resonance(length: int) -> None:
    sweep, at = sound(6), 500
    points = (np.arange(801) >= at) & (np.arange(801) < at + length)
    gated = gate({"disk": (with_factor(sweep, np.where(points, 1 + 0.004 / np.sqrt(length), 1.0)),)})
    (glitch,) = gated.checks[0].abrupt
    assert glitch.kind == "glitch"
    assert glitch.band_Hz == (sweep.frequency[at], sweep.frequency[at + length - 1])
    assert gated.sweeps["disk"][0].frequency.size == 801 - length


def test_a_sharp_further_resonance_is_not_a_glitch() -> None:
    sweep = sound(7)
    f, f_k = sweep.frequency, sweep.frequency[500]
    C = 3e-4 / (2 * np.pi * f[400] * abs(sweep.impedance[400]))
    branch = 2j * np.pi * f * C / (1 - (f / f_k) ** 2 + 1j * f / f_k / 120)
    gated = gate({"disk": (replace(sweep, impedance=1 / (1 / sweep.impedance + branch)),)})
    assert gated.checks[0].abrupt == ()


def test_negative_inverted_and_unrepeatable_data_are_reported() -> None:
    sweep = sound(8)
    gated = gate(
        {
            "disk": (replace(sweep, impedance=sweep.impedance - 3.0),),
            "ml1": (replace(sweep, impedance=-sweep.impedance),),
        }
    )
    assert {one.kind for one in gated.checks[0].troubles} >= {"not passive"}
    assert gated.turned == {"ml1": "inverted"}
    mirrored = gate({"disk": (replace(sweep, impedance=np.conj(sweep.impedance)),)})
    assert mirrored.turned == {"disk": "conjugated"}
    np.testing.assert_allclose(mirrored.sweeps["disk"][0].impedance, sweep.impedance)
    again = with_factor(sweep, 1 + 2e-3 * (sweep.frequency / sweep.frequency[-1]))
    _, second = gate({"disk": (sweep, again)}).checks
    assert [one.kind for one in second.troubles] == ["not repeated"]


def test_a_resonance_between_the_points_is_too_coarse() -> None:
    sweep = sound(9)
    (check,) = gate({"disk": (replace(sweep, frequency=sweep.frequency[::6], impedance=sweep.impedance[::6]),)}).checks
    assert "too coarse" in {one.kind for one in check.troubles}


@pytest.mark.long
def test_the_glitch_of_the_real_kapton_transducer_is_found_and_others_pass(recordings: Path) -> None:
    t64 = read_recording(recordings / "pvdf-on-kapton" / "T64.csv")
    for seed in (None, 2, 5):  # as written in the file, and as rounded by arithmetic
        off = 0.0 if seed is None else 1e-15 * np.random.default_rng(seed).standard_normal(t64.frequency.size)
        (check,) = gate({"t": (with_factor(t64, 1 + off),)}).checks
        (jump,) = check.troubles
        assert (jump.kind, jump.size) == ("step", pytest.approx(0.0337, rel=0.01))
        assert jump.band_Hz[1] == pytest.approx(148e6, rel=0.002)
        assert check.noise == pytest.approx(3.088e-3, rel=1e-3)
    for name in ("disk-20x2/thickness-mode.csv", "disk-35x2/radial-mode-1.csv", "pvdf-on-kapton/T61.csv"):
        assert gate({"t": (read_recording(recordings / name),)}).checks[0].abrupt == ()
    (inverted,) = gate({"t": (read_recording(recordings / "hp4294a-exports" / "sampleadmittance.txt"),)}).checks
    assert (inverted.turned, inverted.abrupt) == ("inverted", ())
