"""The world of the concealed sets against what is known about plates, lines, disks and filters."""

import hashlib
import json
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
from pzctl.sim.blind_cases.detectability import imitate, sized
from pzctl.sim.blind_cases.device_under_test import DENSITY, DeviceUnderTest, random_specimen
from pzctl.sim.blind_cases.injected_effect import Scenario, path_plant
from pzctl.sim.blind_cases.node_circuit import Path as Way
from pzctl.sim.blind_cases.node_circuit import measured_impedance
from pzctl.sim.blind_cases.recording_process import SweepSpec, noisy, record
from pzctl.sim.blind_cases.ritz import finite_disk_admittance
from pzctl.sim.blind_cases.scenario import NOTHING
from pzctl.sim.blind_cases.scenario_draw import by_other_names
from pzctl.sim.blind_cases.waves import LayerColumn, Slice, respond


def specimen_of(seed: int, steps: int = 1) -> DeviceUnderTest:
    return random_specimen(np.random.default_rng(seed), "x", steps, backed=False)


def grid(specimen: DeviceUnderTest, top: float = 3.4, points: int = 801) -> np.ndarray:
    return np.linspace(0.12, top, points) * specimen.disk.f0


def test_free_plate_is_the_textbooks() -> None:
    disk = specimen_of(1).disk
    f = grid(specimen_of(1))
    omega = 2 * np.pi * f
    plate = Slice(disk.thickness, DENSITY, disk.c33D, disk.h33, disk.eps33S)
    half = omega * disk.thickness / 2 / np.sqrt(disk.c33D / DENSITY)
    kt2 = disk.h33**2 * disk.eps33S / disk.c33D
    textbook = disk.thickness / (1j * omega * disk.eps33S) * (1 - kt2 * np.tan(half) / half)
    np.testing.assert_allclose(respond(omega, LayerColumn((plate,), 0.0, 0.0)).specific_impedance, textbook, rtol=1e-9)


@given(cuts=st.lists(st.floats(0.05, 0.95), min_size=1, max_size=4, unique=True), seed=st.integers(0, 99))
@settings(max_examples=25, deadline=None)
def test_a_plate_may_be_cut_anywhere(cuts: list[float], seed: int) -> None:
    disk = specimen_of(seed).disk
    omega = 2 * np.pi * grid(specimen_of(seed), points=60)
    edges = np.array([0.0, *sorted(cuts), 1.0]) * disk.thickness
    parts = tuple(Slice(float(t), DENSITY, disk.c33D, disk.h33, disk.eps33S) for t in np.diff(edges))
    whole = Slice(disk.thickness, DENSITY, disk.c33D, disk.h33, disk.eps33S)
    cut = respond(omega, LayerColumn(parts, 1e6, 413.0)).specific_impedance
    np.testing.assert_allclose(cut, respond(omega, LayerColumn((whole,), 1e6, 413.0)).specific_impedance, rtol=1e-8)


def test_ladder_is_a_line() -> None:
    omega = 2 * np.pi * np.linspace(1e5, 1.5e7, 50)
    device = 1j * omega * 1e-9 + 1e-3
    tan = np.tan(omega * 2e-9)
    line = 50 * (1 / device + 50j * tan) / (50 + 1j * tan / device)
    np.testing.assert_allclose(measured_impedance(omega, device, Way(delay=2e-9)), line, rtol=2e-4)


def test_first_radial_resonance_of_the_wide_disk() -> None:
    """Thin-disk theory, with the correction of finite thickness (reference: -(c13E/c33E)^2 (t/D)^2 (eta^2/6 + 1/4))."""
    s = replace(specimen_of(3), diameter=15e-3)
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
    s = specimen_of(4)
    take = SweepSpec("disk", grid(s, 1.5), seconds=100.0)
    lag_Hz = 0.005 * (take.frequency[-1] - take.frequency[0]) / 100
    late = 1 / record(s, replace(NOTHING, settling=0.005), take)
    earlier = 1 / record(s, NOTHING, replace(take, frequency=take.frequency - lag_Hz))
    np.testing.assert_allclose(late[5:], earlier[5:], rtol=2e-4)
    back = 1 / record(s, replace(NOTHING, settling=0.005), replace(take, down=True))
    later = 1 / record(s, NOTHING, replace(take, frequency=take.frequency + lag_Hz))
    np.testing.assert_allclose(back[:-5], later[:-5], rtol=2e-4)


def test_drive_bends_the_resonance_downwards_and_in_proportion() -> None:
    s = specimen_of(5)
    f = np.linspace(0.8, 1.0, 2001) * s.disk.f0
    low, mid, high = (
        f[np.argmin(np.abs(record(s, replace(NOTHING, softening=1e3), SweepSpec("disk", f, level_V=level))))]
        for level in (1e-6, 0.05, 0.1)
    )
    assert high < mid < low
    assert (low - high) / (low - mid) == pytest.approx(2, rel=0.25)


def test_noise_is_what_the_take_says() -> None:
    s = specimen_of(6)
    take = SweepSpec("disk", grid(s), noise=6e-4)
    z = record(s, NOTHING, take)
    error = np.log(noisy(z, take, np.random.default_rng(0)) / z)
    assert np.std(error.real) == pytest.approx(6e-4, rel=0.1)
    assert np.std(error.imag) == pytest.approx(6e-4, rel=0.1)


def test_electrode_mass_hides_in_the_constants_and_an_inductance_does_not() -> None:
    rng, s = np.random.default_rng(7), specimen_of(7)
    take = SweepSpec("disk", grid(s, 1.5))
    shifted = np.sum(
        np.abs(np.log(record(s, replace(NOTHING, mass=(2e-3, 2e-3)), take) / record(s, NOTHING, take))) ** 2
    )
    hidden = imitate(Scenario(s, (layered.mass(rng, s).at(2.0),)), 0, (take,))
    assert hidden.gain < 10 < 1e-3 * shifted / take.noise**2
    assert hidden.specimen.disk.c33D.real < 0.9995 * s.disk.c33D.real
    lead = path_plant("lead-inductance", ("disk",), 30.0, inductance=1e-8)
    _, seen = sized(Scenario(s, (lead,)), 0, (take,), 1000.0)
    assert 600 < seen.gain < 1600


def test_cases_are_the_same_for_ever_and_their_truth_is_sealed(tmp_path: Path) -> None:
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


def test_what_hides_in_the_constants_and_moves_them_is_to_be_listed(tmp_path: Path) -> None:
    truth = make_case(tmp_path, seed=96, index=439)
    (mass,) = truth["hidden"]
    assert truth["not_decidable"] == [mass["effect"]] == ["electrode-mass"]
    assert mass["gain"] < 6
    assert truth["findings"] == []


def test_a_cable_too_short_to_have_a_capacitance_is_a_lead_as_well() -> None:
    specimen = specimen_of(1)
    f = grid(specimen, top=1.5, points=101)
    takes = (SweepSpec("disk", f),)
    for delay, names in ((1e-10, ("lead-inductance",)), (1e-8, ())):
        cable = path_plant("cable", ("disk",), 12.0, delay=delay)
        (told,) = by_other_names(Scenario(specimen, (cable,)), takes)
        assert told.accept == names
