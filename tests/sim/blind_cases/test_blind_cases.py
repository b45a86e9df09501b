"""The simulation of the blind cases compared with textbook results for plates, lines, disks and filters."""

import hashlib
import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import brentq
from scipy.special import j0, j1

from pzctl.sim.blind_cases import layer_families as layered
from pzctl.sim.blind_cases.case_files import make_case, make_cases
from pzctl.sim.blind_cases.detectability import fit_without, scaled_to_gain
from pzctl.sim.blind_cases.device_under_test import DENSITY, DeviceUnderTest, random_device
from pzctl.sim.blind_cases.injected_effect import Scenario, path_effect
from pzctl.sim.blind_cases.node_circuit import Path as Way
from pzctl.sim.blind_cases.node_circuit import measured_impedance
from pzctl.sim.blind_cases.recording_process import SweepSpec, noisy, record
from pzctl.sim.blind_cases.ritz import finite_disk_admittance
from pzctl.sim.blind_cases.scenario import NOTHING
from pzctl.sim.blind_cases.scenario_draw import with_alternative_names
from pzctl.sim.blind_cases.waves import LayerColumn, Slice, respond


def device_of(seed: int, steps: int = 1) -> DeviceUnderTest:
    return random_device(np.random.default_rng(seed), "x", steps, backed=False)


def grid(device: DeviceUnderTest, top: float = 3.4, points: int = 801) -> np.ndarray:
    return np.linspace(0.12, top, points) * device.disk.f0


def test_a_free_plate_has_the_textbook_impedance() -> None:
    disk = device_of(1).disk
    f = grid(device_of(1))
    omega = 2 * np.pi * f
    plate = Slice(disk.thickness, DENSITY, disk.c33D, disk.h33, disk.eps33S)
    half = omega * disk.thickness / 2 / np.sqrt(disk.c33D / DENSITY)
    kt2 = disk.h33**2 * disk.eps33S / disk.c33D
    textbook = disk.thickness / (1j * omega * disk.eps33S) * (1 - kt2 * np.tan(half) / half)
    np.testing.assert_allclose(respond(omega, LayerColumn((plate,), 0.0, 0.0)).specific_impedance, textbook, rtol=1e-9)


@given(cuts=st.lists(st.floats(0.05, 0.95), min_size=1, max_size=4, unique=True), seed=st.integers(0, 99))
@settings(max_examples=25, deadline=None)
def test_a_plate_may_be_cut_anywhere(cuts: list[float], seed: int) -> None:
    disk = device_of(seed).disk
    omega = 2 * np.pi * grid(device_of(seed), points=60)
    edges = np.array([0.0, *sorted(cuts), 1.0]) * disk.thickness
    parts = tuple(Slice(float(t), DENSITY, disk.c33D, disk.h33, disk.eps33S) for t in np.diff(edges))
    whole = Slice(disk.thickness, DENSITY, disk.c33D, disk.h33, disk.eps33S)
    cut = respond(omega, LayerColumn(parts, 1e6, 413.0)).specific_impedance
    np.testing.assert_allclose(cut, respond(omega, LayerColumn((whole,), 1e6, 413.0)).specific_impedance, rtol=1e-8)


def test_the_ladder_is_a_transmission_line() -> None:
    omega = 2 * np.pi * np.linspace(1e5, 1.5e7, 50)
    device = 1j * omega * 1e-9 + 1e-3
    tan = np.tan(omega * 2e-9)
    line = 50 * (1 / device + 50j * tan) / (50 + 1j * tan / device)
    np.testing.assert_allclose(measured_impedance(omega, device, Way(delay=2e-9)), line, rtol=2e-4)


def test_first_radial_resonance_of_the_wide_disk() -> None:
    """Thin-disk theory, with the correction of finite thickness (reference: -(c13E/c33E)^2 (t/D)^2 (eta^2/6 + 1/4))."""
    s = replace(device_of(3), diameter=15e-3)
    s = replace(s, disk=replace(s.disk, thickness=0.6e-3))
    c33E = (s.disk.c33D - s.disk.h33**2 * s.disk.eps33S).real
    c11p, c12p = 147e9 - 93.7e9**2 / c33E, 105e9 - 93.7e9**2 / c33E
    sigma = c12p / c11p
    eta = float(brentq(lambda x: x * j0(x) - (1 - sigma) * j1(x), 1.5, 2.5))
    thin = eta * np.sqrt(c11p / DENSITY) / (2 * np.pi * s.diameter / 2)
    wanted = thin * (1 - (93.7e9 / c33E) ** 2 * (0.6 / 15) ** 2 * (eta**2 / 6 + 0.25))
    f = np.linspace(0.97, 1.03, 601) * wanted
    peak = f[np.argmax(finite_disk_admittance(f, s).real)]
    assert peak == pytest.approx(wanted, rel=5e-4)


def test_slow_detector_shows_an_earlier_frequency() -> None:
    s = device_of(4)
    sweep = SweepSpec("disk", grid(s, 1.5), seconds=100.0)
    lag_Hz = 0.005 * (sweep.frequency[-1] - sweep.frequency[0]) / 100
    late = 1 / record(s, replace(NOTHING, settling=0.005), sweep)
    earlier = 1 / record(s, NOTHING, replace(sweep, frequency=sweep.frequency - lag_Hz))
    np.testing.assert_allclose(late[5:], earlier[5:], rtol=2e-4)
    back = 1 / record(s, replace(NOTHING, settling=0.005), replace(sweep, down=True))
    later = 1 / record(s, NOTHING, replace(sweep, frequency=sweep.frequency + lag_Hz))
    np.testing.assert_allclose(back[:-5], later[:-5], rtol=2e-4)


def test_drive_bends_the_resonance_downwards_and_in_proportion() -> None:
    s = device_of(5)
    f = np.linspace(0.8, 1.0, 2001) * s.disk.f0
    low, mid, high = (
        f[np.argmin(np.abs(record(s, replace(NOTHING, softening=1e3), SweepSpec("disk", f, level_V=level))))]
        for level in (1e-6, 0.05, 0.1)
    )
    assert high < mid < low
    assert (low - high) / (low - mid) == pytest.approx(2, rel=0.25)


def test_noise_is_as_large_as_the_sweep_specifies() -> None:
    s = device_of(6)
    sweep = SweepSpec("disk", grid(s), noise=6e-4)
    z = record(s, NOTHING, sweep)
    error = np.log(noisy(z, sweep, np.random.default_rng(0)) / z)
    assert np.std(error.real) == pytest.approx(6e-4, rel=0.1)
    assert np.std(error.imag) == pytest.approx(6e-4, rel=0.1)


def test_constants_absorb_an_electrode_mass_but_no_inductance() -> None:
    rng, s = np.random.default_rng(7), device_of(7)
    sweep = SweepSpec("disk", grid(s, 1.5))
    shifted = np.sum(
        np.abs(np.log(record(s, replace(NOTHING, mass=(2e-3, 2e-3)), sweep) / record(s, NOTHING, sweep))) ** 2
    )
    hidden = fit_without(Scenario(s, (layered.mass(rng, s).at(2.0),)), 0, (sweep,))
    assert hidden.gain < 10 < 1e-3 * shifted / sweep.noise**2
    assert hidden.device.disk.c33D.real < 0.9995 * s.disk.c33D.real
    lead = path_effect("lead-inductance", ("disk",), 30.0, inductance=1e-8)
    _, seen = scaled_to_gain(Scenario(s, (lead,)), 0, (sweep,), 1000.0)
    assert 600 < seen.gain < 1600


def test_a_seed_always_gives_the_same_cases_and_a_sealed_truth(tmp_path: Path) -> None:
    sealed = make_cases(tmp_path / "a", seed=3, count=4)
    assert make_cases(tmp_path / "b", seed=3, count=4) == sealed
    assert make_cases(tmp_path / "c", seed=4, count=4) != sealed
    data = (tmp_path / "a" / "truth.json").read_bytes()
    assert hashlib.sha256(data).hexdigest() == sealed
    for name, truth in json.loads(data).items():
        folder = tmp_path / "a" / "cases" / name
        written = {path.name for path in folder.glob("*.csv")}
        assert written == {file for files in truth["files"].values() for file in files}
        assert not any(word in (folder / "build.toml").read_text() for word in ("gain", "effect", "truth"))


def test_an_absorbed_effect_that_biases_a_constant_must_be_listed(tmp_path: Path) -> None:
    truth = make_case(tmp_path, seed=96, index=439)
    (mass,) = truth["hidden"]
    assert truth["not_decidable"] == [mass["effect"]] == ["electrode-mass"]
    assert mass["gain"] < 6
    assert truth["findings"] == []


def test_a_cable_of_undetectable_capacitance_may_be_called_a_lead() -> None:
    device = device_of(1)
    f = grid(device, top=1.5, points=101)
    sweeps = (SweepSpec("disk", f),)
    for delay, names in ((1e-10, ("lead-inductance",)), (1e-8, ())):
        cable = path_effect("cable", ("disk",), 12.0, delay=delay)
        (told,) = with_alternative_names(Scenario(device, (cable,)), sweeps)
        assert told.accept == names


@pytest.mark.system
def test_cases_that_cannot_be_written_are_one_sentence(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    words = [sys.executable, "-P", "-m", "pzctl.sim.blind_cases", str(tmp_path / "file" / "proof"), "1", "1", "1"]
    done = subprocess.run(words, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert done.stderr.startswith(str(tmp_path / "file"))
    assert done.stderr.endswith(": the cases cannot be written: Not a directory\n")
    assert done.stderr.count("\n") == 1
