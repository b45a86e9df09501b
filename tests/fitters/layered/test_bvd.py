"""The equivalent circuit: as many resonances as there are, none that is not there, and the same in SPICE."""

import numpy as np
import pytest

from pzctl.fitters.interface import FitTask
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


@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("seed", [1, 2, 3])
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
