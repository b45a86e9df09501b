"""Effects planted in real recordings: exact for two-ports, computed in time for others, none of unrealistic size."""

import json
from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.cli.proof.plant_real import NothingToPlantError, plant_all, sources
from pzctl.drivers.recordings import read_recording
from pzctl.sim.blind_cases.planted_parts import PARTS, alike, moves, own_noise, sized

BUILD = """
name = "x"
diameter_mm = 10
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = 1.0
[load]
back = "air"
front = "air"
[[steps]]
name = "bare"
layers = ["disk"]
"""
F = np.linspace(1.5e6, 3e6, 301)


def device(f: np.ndarray) -> np.ndarray:
    """A resonator in parallel with a capacitance."""
    C0, C1, Q, fs = 6e-10, 1.5e-10, 80, 2e6
    series = (1 + 1j * f / fs / Q - (f / fs) ** 2) / (2j * np.pi * f * C1)
    return 1 / (2j * np.pi * f * C0 + 1 / series)


def write(folder: Path) -> None:
    folder.mkdir(parents=True)
    rows = [f"{f!r},{z.real!r},{z.imag!r}" for f, z in zip(F.tolist(), device(F).tolist(), strict=True)]
    (folder / "bare.csv").write_text("\n".join(["frequency_Hz,R_ohm,X_ohm", *rows]))


def test_each_planted_effect_is_written_once_as_the_truth_states(tmp_path: Path) -> None:
    write(tmp_path / "real" / "unit")
    (tmp_path / "real" / "unit" / "build.toml").write_text(BUILD)
    (tmp_path / "real" / "unit" / "notes.txt").write_text("no recording")
    plant_all(tmp_path / "real", tmp_path / "out", 3)
    truths = json.loads((tmp_path / "out" / "truth.json").read_text())
    assert {one.get("effect") for one in truths.values()} >= {"lead-inductance", "stray-capacitance", "sweep-lag", None}
    z = device(F)
    for effect, by in (
        ("lead-inductance", lambda size: z + 2j * np.pi * F * size),
        ("leakage", lambda size: 1 / (1 / z + size)),
        ("stray-capacitance", lambda size: 1 / (1 / z + 2j * np.pi * F * size)),
    ):
        truth = truths[f"unit.bare-{effect}"]
        recorded = read_recording(tmp_path / "out" / "cases" / f"unit.bare-{effect}" / "bare.csv")
        np.testing.assert_allclose(recorded.impedance, by(truth["size"]), rtol=1e-7)
        assert moves(z, recorded.impedance) == pytest.approx(truth["moves"], rel=1e-6)
    pair = sorted((tmp_path / "out" / "cases" / "unit.bare-sweep-lag").glob("*.csv"))
    assert [path.name for path in pair] == ["bare-2.csv", "bare.csv"]
    assert read_recording(pair[0]).settings["direction"] == "down"
    again = plant_all(tmp_path / "real", tmp_path / "again", 3)
    assert again == plant_all(tmp_path / "real", tmp_path / "once more", 3)


def test_what_has_no_build_is_passed_over(tmp_path: Path) -> None:
    write(tmp_path / "real" / "unit")
    assert list(sources(tmp_path / "real")) == []
    with pytest.raises(NothingToPlantError, match=r"no recording with a build\.toml"):
        plant_all(tmp_path / "real", tmp_path / "out", 1)


def test_published_devices_have_a_build_file_in_the_repository(recordings: Path) -> None:
    assert [one.name for one in sources(recordings)] == [
        "disk-20x2.thickness-mode",
        "pvdf-on-kapton.T61",
        "pvdf-on-kapton.T64",
    ]


def test_a_drift_shifts_frequencies_and_a_lag_delays_the_reading() -> None:
    drift, lag = (next(one for one in PARTS if one.effect == name) for name in ("temperature-drift", "sweep-lag"))
    f = np.linspace(F[0], F[-1], 3001)
    z = device(f)
    drifted = drift.apply(f, z, 1e-3, True)
    at = f / (1 + 1e-3 * (2 - np.linspace(0, 1, f.size)))
    np.testing.assert_allclose(drifted[3:-3], (device(at) * at / f)[3:-3], rtol=2e-5)
    late = 1 / lag.apply(f, z, 300.0, False)
    np.testing.assert_allclose(late[9:-3], (1 / device(f - 300.0))[9:-3], rtol=2e-3)


def test_a_short_cable_equals_a_lead_only_at_low_impedance() -> None:
    cable = next(one for one in PARTS if one.effect == "cable")
    low = 1 / (2j * np.pi * F * 1e-8) + 0.1
    assert alike(cable, F, low, 1e-9) == ("lead-inductance",)
    assert alike(cable, F, low * 100, 1e-7) == ()


def test_unrealistic_sizes_are_not_planted_and_noise_is_estimated() -> None:
    lag = next(one for one in PARTS if one.effect == "sweep-lag")
    flat = 1 / (2j * np.pi * F * 1e-9)
    assert sized(lag, F, flat, 0.1) is None
    rng = np.random.default_rng(0)
    noisy = flat * (1 + 3e-4 * (rng.standard_normal(F.size) + 1j * rng.standard_normal(F.size)))
    assert own_noise(noisy) == pytest.approx(3e-4, rel=0.2)
