"""A stack as a netlist of lossy lines: its impedance by nodal analysis, which shares no formula with the stack."""

import cmath
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from pzctl.models.base.arrays import Complexes, Frequencies
from pzctl.models.circuits.mason_netlist import NetlistError, as_circuit, mason_netlist, reference_of
from pzctl.models.stack.bolt import Bolt
from pzctl.models.stack.layers import Elastic, Piezo
from pzctl.models.stack.loads import AIR, HalfSpace, Support
from pzctl.models.stack.lumps import Mass, Spring
from pzctl.models.stack.stack import Stack

F = np.linspace(0.8e6, 6e6, 61)
DISK = Piezo("disk", 5e-4, 7700, 1.5e11 * (1 + 0.012j), 2e9 * (1 + 0.003j), 7.5e-9 * (1 - 0.015j))
GLUE, ML1 = Elastic("glue 1", 1e-5, 2.8e6, 2450, 13), Elastic("ml1", 1.4e-4, 11e6, 2500, 20)
TWO = (DISK, GLUE, Piezo("ring", 4e-4, 7600, 1.4e11 + 1e9j, 1.9e9 + 0j, 7e-9 - 8e-11j, polarity=-1), ML1)
STACKS = {
    "disk": Stack((DISK,), AIR, AIR, 2e-4),
    "layers": Stack((DISK, GLUE, ML1), AIR, HalfSpace("water", 1.5e6), 2e-4),
    "series": Stack(TWO, AIR, AIR, 2e-4),
    "parallel": Stack(TWO, AIR, AIR, 2e-4, connection="parallel"),
    "bolt": Stack((ML1, DISK, GLUE, Elastic("head", 3e-4, 17e6, 6300)), area=2e-4, bolt=Bolt("ml1", "head", 4e8)),
    "lumps": Stack((Mass("silver", 0.05), DISK, Spring("bond", 1e15, 30), ML1), AIR, AIR, 2e-4),
}


def nodal_impedance(netlist: str, f: Frequencies) -> Complexes:
    """Return Z between `hot` and `cold`, by modified nodal analysis with 0 and `cold` as ground."""
    lines = [line.split() for line in netlist.splitlines() if line[0] not in "*."]
    models = {
        line.split()[1]: {
            key: float(value) for key, value in (pair.split("=") for pair in line.split("LTRA(")[1][:-1].split())
        }
        for line in netlist.splitlines()
        if line.startswith(".model")
    }
    ports = {"R": 2, "L": 2, "C": 2, "V": 2, "F": 2, "O": 4, "E": 4, "G": 4}
    nodes = sorted({node for line in lines for node in line[1 : 1 + ports[line[0][0]]]} - {"0", "cold"})
    sources = [line[0] for line in lines if line[0][0] in "VE"]
    at = {name: k for k, name in enumerate([*nodes, *sources])}
    return np.array([_impedance(lines, models, at, w) for w in 2 * np.pi * f])


def _impedance(lines: list[list[str]], models: dict[str, dict[str, float]], at: dict[str, int], w: float) -> complex:  # noqa: C901 (a case a kind)
    A = np.zeros((len(at), len(at)), np.complex128)

    def stamp(row: str, column: str, value: complex) -> None:
        if row in at and column in at:
            A[at[row], at[column]] += value

    def transfer(out: list[str], into: list[str], y: complex) -> None:
        for one, sign in zip(out, (1, -1), strict=True):
            stamp(one, into[0], sign * y)
            stamp(one, into[1], -sign * y)

    def voltage(name: str, nodes: list[str]) -> None:
        for node, sign in zip(nodes, (1, -1), strict=True):
            stamp(node, name, sign)
            stamp(name, node, sign)

    for name, *words in lines:
        match name[0]:
            case "R" | "L" | "C":
                transfer(words[:2], words[:2], _admittance(name[0], float(words[2]), w))
            case "O":
                own, other = _line(models[words[4]], w)
                for k in (0, 2):
                    transfer(words[k : k + 2], words[k : k + 2], own)
                    transfer(words[k : k + 2], words[2 - k : 4 - k], other)
            case "G":
                transfer(words[:2], words[2:4], float(words[4]))
            case "F":
                stamp(words[0], words[2], float(words[3]))
                stamp(words[1], words[2], -float(words[3]))
            case "V":
                voltage(name, words[:2])
            case "E":
                voltage(name, words[:2])
                stamp(name, words[2], -float(words[4]))
                stamp(name, words[3], float(words[4]))
            case _:
                raise AssertionError(name)
    current = np.zeros(len(at), np.complex128)
    current[at["hot"]] = 1
    return complex(np.linalg.solve(A, current)[at["hot"]])


def _admittance(kind: str, value: float, w: float) -> complex:
    return {"R": 1 / value, "L": 1 / (1j * w * value), "C": 1j * w * value}[kind] if value else 1e12


def _line(line: dict[str, float], w: float) -> tuple[complex, complex]:
    """Return the admittances of a lossy line: of an end with the other shorted, and from one end to the other."""
    series, shunt = line["R"] + 1j * w * line["L"], 1j * w * line["C"]
    theta, admittance = cmath.sqrt(series * shunt) * line["LEN"], cmath.sqrt(shunt / series)
    return admittance / cmath.tanh(theta), -admittance / cmath.sinh(theta)


@pytest.mark.parametrize("name", STACKS)
def test_the_netlist_has_the_impedance_of_the_stack(name: str) -> None:
    stack = STACKS[name]
    netlist, exact = mason_netlist(stack, "S4-disk.1"), np.array([reference_of(stack)])
    assert "\n.subckt S4_disk_1 hot cold\n" in netlist
    assert nodal_impedance(netlist, exact) == pytest.approx(stack.impedance(exact), rel=1e-6)
    if "bond" not in netlist:  # a spring has no loss law that could follow the circuit's away from there
        assert nodal_impedance(netlist, F) == pytest.approx(as_circuit(stack).impedance(F), rel=1e-5)


def test_a_load_that_no_netlist_has_is_refused() -> None:
    with pytest.raises(NetlistError, match="is no half-space"):
        mason_netlist(Stack((DISK,), Support("jig", stiffness=1e12), AIR, 2e-4), "x")


@pytest.mark.system
@pytest.mark.skipif(shutil.which("ngspice") is None, reason="ngspice is not installed")
@pytest.mark.parametrize("name", ["layers", "parallel", "bolt"])
def test_ngspice_computes_the_same(name: str, tmp_path: Path) -> None:
    commands = f"ac lin {F.size} {F[0]} {F[-1]}\nset numdgt=12\nwrdata out.txt i(V1)\nquit 0"
    deck = f"* {name}\n{mason_netlist(STACKS[name], 'x')}V1 n 0 AC 1\nX1 n 0 x\n.control\n{commands}\n.endc\n.end\n"
    (tmp_path / "x.cir").write_text(deck, encoding="utf-8")
    subprocess.run(["ngspice", "-b", "x.cir"], cwd=tmp_path, check=True, capture_output=True, timeout=60)
    _, real, imaginary = np.loadtxt(tmp_path / "out.txt").T
    assert -1 / (real + 1j * imaginary) == pytest.approx(as_circuit(STACKS[name]).impedance(F), rel=1e-4)
