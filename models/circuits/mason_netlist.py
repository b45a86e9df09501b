"""A stack as a SPICE subcircuit of transmission lines: Mason's model, in the form of Leach and of Püttmer.

In the acoustic part a voltage is a velocity (m/s) and a current is a force (N). A layer is then a line whose series
element is its compliance, so that the loss of the stiffness is the line's series resistance, which every SPICE knows
(LTRA). The electric part couples to it by controlled sources, without a negative capacitance or a transformer (Leach,
IEEE TUFFC 41 (1994) 60; lossy lines: Püttmer et al., IEEE TUFFC 44 (1997) 60).

SPICE has no loss that is the same at all frequencies: the circuit equals the stack exactly at one frequency, and
`as_circuit` is the stack that the circuit describes at all.
"""

import math
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..base.arrays import Frequencies
from ..base.errors import CannotError
from ..stack.graded import sections_by_layer
from ..stack.layers import Elastic, Piezo
from ..stack.loads import HalfSpace, Load
from ..stack.loss_laws import ComplexLike, LossLaw
from ..stack.lumps import Mass, Spring
from ..stack.stack import Layer, Stack

_LEAK_ohm = 1e12
"""Gives an integrator a direct-current path, without an effect above a hertz."""
_FREE_ohm = 1e9
"""Of a free face: 1e9 m/s per newton."""


class NetlistError(CannotError):
    """A stack has a part that no netlist describes."""


@dataclass(frozen=True)
class CircuitLoss(LossLaw):
    """A constant as a circuit of fixed resistors has it: exact at one frequency.

    `form`: `line` for a stiffness, whose loss falls with frequency, `shunt` for a permittivity, whose loss falls too,
    `series` for h33, whose loss rises.
    """

    form: str
    at: float
    """Hz."""

    def parameters(self) -> Mapping[str, float]:
        """Return nothing: the law has no parameter."""
        return {}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the law itself: it has no parameter."""
        return self

    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return the constant at frequencies in Hz, shape (N,), in the unit of `value`."""
        if self.form == "line":
            compliance = 1 / value
            lossy = compliance.real + 1j * compliance.imag * self.at / frequency
            return np.asarray(1 / lossy, np.complex128)
        ratio = self.at / frequency if self.form == "shunt" else frequency / self.at
        return np.asarray(value.real + 1j * value.imag * ratio, np.complex128)

    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return nothing: a netlist is not fitted."""
        return {}


def reference_of(stack: Stack) -> float:
    """Return the frequency in Hz at which the netlist is exact: half a wave in the first piezoelectric layer."""
    layer = next(one for one in stack.layers if isinstance(one, Piezo))
    return math.sqrt(layer.c33D.real / layer.density) / (2 * layer.thickness)


def as_circuit(stack: Stack, at: float | None = None) -> Stack:
    """Return the stack that the netlist describes at all frequencies; it equals `stack` at `at` (Hz)."""
    at = reference_of(stack) if at is None else at
    line, shunt, series = (CircuitLoss(form, at) for form in ("line", "shunt", "series"))
    f = np.array([at])

    def fixed(layer: Layer) -> Layer:
        if isinstance(layer, Piezo):
            c, h, eps = (law.over(value, f) for value, law in _constants(layer))
            own = {"c33D": complex(np.ravel(c)[0]), "h33": complex(np.ravel(h)[0]), "eps33S": complex(np.ravel(eps)[0])}
            return replace(layer, **own, c_law=line, h_law=series, eps_law=shunt)
        if isinstance(layer, Elastic):
            c33 = complex(np.ravel(layer.law.over(layer.c33, f))[0])
            c = math.sqrt(c33.real / layer.density)
            q = c33.real / c33.imag if c33.imag else math.inf
            return Elastic(layer.name, layer.thickness, layer.density * c, c, q, line)
        return layer

    return replace(stack, layers=tuple(fixed(layer) for layer in stack.layers))


def mason_netlist(stack: Stack, name: str, comments: tuple[str, ...] = (), at: float | None = None) -> str:
    """Return the subcircuit of a stack between the nodes `hot` and `cold`; its faces are loaded as those of the stack.

    `comments` are lines above it; `at`: frequency in Hz at which it is exact. Raises NetlistError for a load that is
    not a half-space.
    """
    at = reference_of(stack) if at is None else at
    exact = as_circuit(stack, at)
    title, faces = re.sub(r"\W", "_", name), [f"u{k}" for k in range(len(exact.layers) + 1)]
    lines = [
        *(f"* {line}" for line in comments),
        "* Acoustic nodes: u0 is the back face; volts are m/s, amperes are newtons.",
        f".subckt {title} hot cold",
        f"Rback u0 0 {_load(exact.back, exact.area):.9g}",
    ]
    electric = _terminals(exact)
    for k, layer in enumerate(exact.layers):
        part = f"{k}_" + re.sub(r"\W", "_", layer.name)
        lines += _PARTS[type(layer)](layer, part, (faces[k], faces[k + 1], *electric.get(k, ())), exact.area, at)
    if exact.bolt is not None and (ends := exact.bolt.ends(sections_by_layer(exact.layers))):
        lines.append(f"Lbolt {faces[ends[0]]} {faces[ends[1]]} {1 / exact.bolt.stiffness:.9g}")
    lines.append(f"Rfront {faces[-1]} 0 {_load(exact.front, exact.area):.9g}")
    return "\n".join((*lines, f".ends {title}", ""))


def _constants(layer: Piezo) -> tuple[tuple[complex, LossLaw], ...]:
    return (layer.c33D, layer.c_law), (layer.h33, layer.h_law), (layer.eps33S, layer.eps_law)


def _terminals(stack: Stack) -> dict[int, tuple[str, str]]:
    """Return the two electric nodes of each piezoelectric layer, by its place."""
    places = [k for k, layer in enumerate(stack.layers) if isinstance(layer, Piezo)]
    if stack.connection == "parallel":
        return dict.fromkeys(places, ("hot", "cold"))
    nodes = ["hot", *(f"e{k}" for k in range(1, len(places))), "cold"]
    return {place: (nodes[k], nodes[k + 1]) for k, place in enumerate(places)}


def _load(load: Load, area: float) -> float:
    """Return the resistor of a face, (m/s)/N. Raises NetlistError."""
    if not isinstance(load, HalfSpace):
        raise NetlistError(f"load {load!r} is no half-space; a netlist has none but those")
    return 1 / (load.z * area) if load.z * area > 1 / _FREE_ohm else _FREE_ohm


def _elastic(layer: Elastic, part: str, nodes: tuple[str, ...], area: float, at: float) -> list[str]:
    return _wave_line(part, nodes, (layer.thickness, layer.density, layer.c33), area, at)


def _wave_line(
    part: str, nodes: tuple[str, ...], plate: tuple[float, float, complex], area: float, at: float
) -> list[str]:
    """Return a lossy line, `plate` being thickness (m), density (kg/m3) and stiffness (Pa)."""
    thickness, density, c33 = plate
    compliance = 1 / (c33 * area)
    resistance = -2 * math.pi * at * compliance.imag
    model = f"L={compliance.real:.9g} C={density * area:.9g} R={resistance:.9g} LEN={thickness:.9g}"
    return [f"O{part} {nodes[0]} 0 {nodes[1]} 0 line{part}", f".model line{part} LTRA({model})"]


def _piezo(layer: Piezo, part: str, nodes: tuple[str, ...], area: float, at: float) -> list[str]:
    back, front, plus, minus = nodes
    w, eps, h = 2 * math.pi * at, layer.eps33S, layer.h33
    C0 = eps.real * area / layer.thickness
    lossy = [f"R0{part} c{part} d{part} {-eps.real / (w * C0 * eps.imag):.9g}"] if eps.imag else []
    N = layer.polarity * h.real * C0
    current, strain = (_integrator(f"{kind}{part}", C0, h.imag / (h.real * w * C0) if h.real else 0.0) for kind in "iv")
    return [
        *_wave_line(part, nodes, (layer.thickness, layer.density, layer.c33D), area, at),
        f"V{part} {plus} c{part} 0",
        f"C0{part} c{part} d{part} {C0:.9g}",
        *lossy,
        f"E{part} d{part} {minus} v{part} 0 {N:.9g}",
        f"F{part} 0 i{part} V{part} 1",
        *current,
        f"G{part} {back} {front} i{part} 0 {N:.9g}",
        f"Gv{part} 0 v{part} {back} {front} 1",
        *strain,
    ]


def _integrator(node: str, C: float, R: float) -> list[str]:
    """Return what makes a voltage of the integral of a current into `node`."""
    inner = f"{node}x" if R else "0"
    resistor = [f"R{node} {inner} 0 {R:.9g}"] if R else []
    return [f"C{node} {node} {inner} {C:.9g}", *resistor, f"Rleak{node} {node} 0 {_LEAK_ohm:g}"]


def _spring(layer: Spring, part: str, nodes: tuple[str, ...], area: float, at: float) -> list[str]:
    compliance = 1 / (layer.stiffness * complex(1.0, 1 / layer.q) * area)
    resistance = -2 * math.pi * at * compliance.imag
    return [f"L{part} {nodes[0]} s{part} {compliance.real:.9g}", f"R{part} s{part} {nodes[1]} {resistance:.9g}"]


def _mass(layer: Mass, part: str, nodes: tuple[str, ...], area: float, at: float) -> list[str]:
    return [f"V{part} {nodes[0]} {nodes[1]} 0", f"C{part} {nodes[1]} 0 {layer.mass * area:.9g}"]


_PARTS: dict[type, Callable[..., list[str]]] = {Elastic: _elastic, Piezo: _piezo, Spring: _spring, Mass: _mass}
