"""The equivalent circuit: as many resonances as there are, none that is not there, and the same in SPICE."""

from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.report.tables.fit_tables import fit_table
from pzctl.drivers.recordings import read_recording
from pzctl.fitters.interface import FitError, FitTask
from pzctl.fitters.layered.bvd import ButterworthVanDyke, circuit_of
from pzctl.models.base.arrays import Complexes, Frequencies
from pzctl.models.circuits.lumped import Branch, Lumped
from pzctl.models.circuits.spice import spice_subcircuit
from pzctl.models.sweep import Sweep

F = np.linspace(0.5e6, 3e6, 401)
BRANCHES = (
    Branch.from_resonance(1e6, 80, 6e-11),
    Branch.from_resonance(2.9e6, 60, 6e-12),
    Branch.from_resonance(1.3e6, 120, 4e-12),
)


def recorded(circuit: Lumped, seed: int) -> Sweep:
    rng = np.random.default_rng(seed)
    noise = 3e-4 * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
    return Sweep(F, circuit.impedance(F) * np.exp(noise))


@pytest.mark.parametrize(("count", "seed"), [(1, 1), (2, 2), (3, 3), (3, 4)])
def test_every_resonance_is_found_and_no_other(count: int, seed: int) -> None:
    true = Lumped(5e-10, BRANCHES[:count], tan_delta=0.01)
    result = ButterworthVanDyke().fit(FitTask(None, {"probe": (recorded(true, seed),)}))
    assert set(result.constants) == set(true.parameters()) - {"series.R", "series.L"}
    for name, constant in result.constants.items():
        assert constant.u_re
        assert abs(constant.re - true.parameters()[name]) < 5 * constant.u_re, name


def nodal_impedance(netlist: str, f: Frequencies) -> Complexes:
    """Return Z between `hot` and `cold` by nodal analysis of R, L and C: independent of the circuit's own formulas."""
    elements = [line.split() for line in netlist.splitlines() if line[0] in "RLC"]
    nodes = sorted({node for _, one, other, _ in elements for node in (one, other)} - {"cold"})
    at = {node: k for k, node in enumerate(nodes)}
    made: list[complex] = []
    for w in 2 * np.pi * f:
        Y = np.zeros((len(nodes), len(nodes)), np.complex128)
        for name, one, other, value in elements:
            y = {"R": 1 / float(value), "L": 1 / (1j * w * float(value)), "C": 1j * w * float(value)}[name[0]]
            for a, b in ((one, other), (other, one)):
                if a in at:
                    Y[at[a], at[a]] += y
                    if b in at:
                        Y[at[a], at[b]] -= y
        made.append(complex(np.linalg.inv(Y)[at["hot"], at["hot"]]))
    return np.array(made)


def test_the_netlist_has_the_impedance_of_the_circuit() -> None:
    lossless = Lumped(5e-10, BRANCHES, R=0.7, L=3e-8)
    netlist = spice_subcircuit(lossless, "S4-disk.1")
    assert netlist.startswith(".subckt S4_disk_1 hot cold")
    assert nodal_impedance(netlist, F) == pytest.approx(lossless.impedance(F), rel=1e-6)
    lossy = Lumped(5e-10, BRANCHES, tan_delta=0.01)
    at = np.array([BRANCHES[0].fs])
    assert nodal_impedance(spice_subcircuit(lossy, "x"), at) == pytest.approx(lossy.impedance(at), rel=1e-6)


def test_a_result_gives_its_circuit() -> None:
    result = ButterworthVanDyke().fit(FitTask(None, {"probe": (recorded(Lumped(5e-10, BRANCHES, 0.01), 4),)}))
    assert circuit_of(result).impedance(F) == pytest.approx(result.curves[0].fitted, rel=1e-9)


def test_a_band_between_resonance_and_antiresonance_has_a_level() -> None:
    """The median of B/w is negative in most of it, as in recordings of one mode."""
    true = Lumped(5e-10, (Branch.from_resonance(1e6, 80, 1.5e-10),), tan_delta=0.01)
    f = np.linspace(0.97e6, 1.16e6, 201)
    assert np.median(true.impedance(f).imag) > 0
    noise = 3e-4 * np.random.default_rng(1).normal(size=(2, f.size))
    result = ButterworthVanDyke().fit(
        FitTask(None, {"probe": (Sweep(f, true.impedance(f) * np.exp(noise[0] + 1j * noise[1])),)})
    )
    assert result.rms_log_error < 1e-3
    assert result.constants["C0"].re == pytest.approx(5e-10, rel=0.02)


def test_a_resonance_just_beside_the_band_is_a_branch_but_not_the_first() -> None:
    true = Lumped(2e-9, (Branch.from_resonance(40e3, 80, 7e-11), Branch.from_resonance(52e3, 90, 1.6e-10)), 0.02)
    f = np.linspace(25e3, 50e3, 201)
    noise = 3e-4 * np.random.default_rng(1).normal(size=(2, f.size))
    sweep = Sweep(f, true.impedance(f) * np.exp(noise[0] + 1j * noise[1]))
    result = ButterworthVanDyke().fit(FitTask(None, {"probe": (sweep,)}))
    assert result.rms_log_error < 1e-3
    assert [branch.fs for branch in circuit_of(result).branches] == pytest.approx([40e3, 52e3], rel=1e-3)
    assert result.derived["fs"].re == pytest.approx(40e3, rel=1e-3)


@pytest.mark.long
@pytest.mark.parametrize(
    ("name", "left"),
    [
        ("disk-20x2/thickness-mode.csv", 0.15),
        ("disk-35x2/radial-mode-1.csv", 0.05),
        ("air-40khz/trans_25-50k_001_001.csv", 0.031),
    ],
)
def test_real_recordings_of_one_mode(recordings: Path, name: str, left: float) -> None:
    result = ButterworthVanDyke().fit(FitTask(None, {"probe": (read_recording(recordings / name),)}))
    assert result.rms_log_error < left


def test_a_recording_without_a_resonance_of_a_circuit_is_refused(recordings: Path) -> None:
    sweep = read_recording(recordings / "pvdf-on-kapton" / "T61.csv")
    with pytest.raises(FitError, match=r"^T61.csv shows no resonance that a circuit can describe: of 1 tried, none"):
        ButterworthVanDyke().fit(FitTask(None, {"probe": (sweep,)}))


def test_its_table_has_no_empty_columns() -> None:
    result = ButterworthVanDyke().fit(FitTask(None, {"probe": (recorded(Lumped(5e-10, BRANCHES[:1]), 1),)}))
    assert [column.name for column in fit_table(result, None).columns] == ["constant", "fitted", "unit"]
