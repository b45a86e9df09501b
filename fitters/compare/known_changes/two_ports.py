"""Reciprocal two-ports inserted between analyzer and device, or removed.

A two-port with the chain matrix (A B; C D) transforms an impedance Z to (A Z + B)/(C Z + D); removing it applies the
inverse matrix (Pozar, Microwave Engineering, section 4.4). No model of the device is needed, nothing is linearised.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Impedances, Reals, j_omega
from ....models.circuits.terminals import skin
from ..change import TERMINALS, ChangeSize, Values

VELOCITY = 2e8
"""m/s, of a wave in polyethylene; only length/velocity can be determined."""
_CABLES = 15.0, 400.0
"""Characteristic impedances of cables, ohm."""
_LEADS = 3e-6
"""Inductance of three metres of wire, H."""
_USUAL = 0.03
"""Prior odds of each of about twenty elements, assuming one change in every third pair."""

Matrix = tuple[Complexes, Complexes, Complexes, Complexes]


@dataclass(frozen=True)
class TwoPort:
    """One element between analyzer and device."""

    effect: str
    sizes: tuple[ChangeSize, ...]
    matrix: Callable[[Frequencies, Values], Matrix]
    added: str
    """Sentence if it was inserted."""
    removed: str
    """Sentence if it was removed."""
    taken: bool = False
    """Whether it was present before and was removed."""
    odds: float = _USUAL
    where: str = TERMINALS
    derived: Callable[[Values], dict[str, tuple[float, str]]] | None = None
    """Values derived from its sizes, with units."""

    starts: tuple[tuple[float, ...], ...] = ()
    possible: Callable[[Frequencies, Values], bool] | None = None
    """Whether its name fits these sizes in this band."""

    @property
    def says(self) -> str:
        """A sentence for people."""
        return self.removed if self.taken else self.added

    def apply(self, Z: Impedances, frequency: Frequencies, values: Values) -> Impedances:
        """Return the impedance with it, ohm; or without it, if it was removed."""
        A, B, C, D = self.matrix(frequency, values)
        return (D * Z - B) / (A - C * Z) if self.taken else (A * Z + B) / (C * Z + D)


@dataclass(frozen=True)
class Turned:
    """The sign of Z or of its phase changed."""

    effect: str = "polarity"
    kind: str = "inverted"
    where: str = TERMINALS
    sizes: tuple[ChangeSize, ...] = ()
    odds: float = 0.02
    starts: tuple[tuple[float, ...], ...] = ()

    @property
    def says(self) -> str:
        """A sentence for people."""
        return (
            f"One of the two recordings is {self.kind}: the sign of R, of X or of the phase is not that of the other."
        )

    def apply(self, Z: Impedances, frequency: Frequencies, values: Values) -> Impedances:
        """Return -Z, Z* or -Z*."""
        seen = -Z if "inverted" in self.kind else Z
        return np.conj(seen) if "conjugated" in self.kind else seen


def _series(impedance: Complexes) -> Matrix:
    one = np.ones_like(impedance)
    return one, impedance, np.zeros_like(one), one


def _shunt(admittance: Complexes) -> Matrix:
    one = np.ones_like(admittance)
    return one, np.zeros_like(one), admittance, one


def _lead(f: Frequencies, v: Values) -> Matrix:
    return _series(j_omega(f) * v["inductance"] + v["resistance"] + v["skin"] * _rough(f))


def _rough(f: Frequencies) -> Complexes:
    """Return the skin effect without its internal inductance in the middle of the band, which counts as inductance."""
    middle = float(np.sqrt(f[0] * f[-1]))
    return skin(f) - 1j * f / middle * skin(np.array([middle])).imag


def _resistance(f: Frequencies, v: Values) -> Matrix:
    return _series(v["resistance"] + v["skin"] * skin(f))


def coil(f: Frequencies, v: Values) -> Complexes:
    """Return a coil's impedance in ohm, shape (N,): core and wire parallel to its own capacitance.

    A core's permeability falls as (jf)^-core, with the loss that causality requires, and relaxes far above the band:
    its loss tangent grows with f to `core loss` in the middle. It is that of a part of the flux only, `core part`; the
    rest goes through air. The inductance is that in the middle of the band, with core and the internal one of the wire.
    """
    jw, middle = j_omega(f), float(np.sqrt(f[0] * f[-1]))
    core = _core(f / middle, v) / _core(np.ones(1), v).real
    wire = jw * v["inductance"] * core + v["resistance"] + v["skin"] * _rough(f)
    return wire / (1 + jw * v["own capacitance"] * wire)


def _core(x: Reals, v: Values) -> Complexes:
    """Return the relative permeability of a core, but for a factor, at frequencies relative to the middle, (N,)."""
    part = v["core part"]
    relaxed = 1 - part + part / (1 + 1j * v["core loss"] / part * x)
    return np.asarray((1j * x) ** -v["core"] * relaxed, np.complex128)


def _is_coil(f: Frequencies, v: Values) -> bool:
    """Return whether a coil is one in some part of the band: above its own resonance it is a capacitor."""
    return _is_inductive(f, v) and bool(f[0] < 1 / (2 * np.pi * np.sqrt(v["inductance"] * v["own capacitance"])))


def _is_lead(f: Frequencies, v: Values) -> bool:
    """Return whether an inductance is that of a lead: not more than some metres of wire have, else it is a coil."""
    return _is_inductive(f, v) and v["inductance"] < _LEADS


def _is_inductive(f: Frequencies, v: Values) -> bool:
    """Return whether the inductance exceeds the resistance at the upper end of the band: else it is a resistance."""
    return bool(2 * np.pi * f[-1] * v["inductance"] > v["resistance"])


def _capacitor(f: Frequencies, v: Values) -> Complexes:
    jw = j_omega(f)
    return jw * v["capacitance"] * (1 - 1j * v["loss tangent"])


def _line(f: Frequencies, v: Values) -> Matrix:
    """Return a line: skin effect in its conductors, and an inductance that is that in the middle of the band."""
    Z0, jw = v["impedance"], j_omega(f)
    along = (jw / VELOCITY + 2 * v["loss"] * _rough(f)) * v["length"] * Z0
    across = jw / VELOCITY * v["length"] / Z0
    x, Z = np.sqrt(along * across), np.sqrt(along / across)
    cosh, sinh = np.asarray(np.cosh(x), np.complex128), np.asarray(np.sinh(x), np.complex128)
    return cosh, Z * sinh, sinh / Z, cosh


def _is_cable(f: Frequencies, v: Values) -> bool:
    """Return whether a line's impedance is one of cables: between that of strip lines and twin leads."""
    return _CABLES[0] < v["impedance"] < _CABLES[1]


def _of_line(v: Values) -> dict[str, tuple[float, str]]:
    """Return the circuit elements that a short line is equivalent to."""
    seconds = v["length"] / VELOCITY
    return {"inductance": (seconds * v["impedance"], "H"), "capacitance": (seconds / v["impedance"], "F")}


def _gain(f: Frequencies, v: Values) -> Matrix:
    one = np.ones(f.size, np.complex128)
    return one * np.exp(v["ln gain"]), 0 * one, 0 * one, one


_COIL = (
    ChangeSize("inductance", "H", 3e-5, 2.5),
    ChangeSize("resistance", "ohm", 0.5, 2.5),
    ChangeSize("own capacitance", "F", 1e-11, 1.2),
    ChangeSize("skin", "ohm", 0.1, 2.5),
    ChangeSize("core", "1", 5e-3, 1.2),
    ChangeSize("core loss", "1", 5e-3, 1.5),
    ChangeSize("core part", "1", 0.6, 0.4, limits=(0.05, 1.0)),
)
"""Chokes and tuning coils of 0.2 uH to 5 mH."""
_CAPACITOR = (ChangeSize("capacitance", "F", 1e-10, 2.5), ChangeSize("loss tangent", "1", 2e-3, 1.5))
"""From the picofarad of a jig to the 10 nF of a capacitor."""

_ELEMENTS = (
    TwoPort(
        "lead-inductance",
        (
            ChangeSize("inductance", "H", 5e-8, 1.5),
            ChangeSize("resistance", "ohm", 0.02, 2.0),
            ChangeSize("skin", "ohm", 3e-3, 2.0),
        ),
        _lead,
        "A series inductance was put in: a wire, a clip, a longer lead.",
        "A series inductance is gone: a wire, a clip, a longer lead.",
        possible=_is_lead,
    ),
    TwoPort(
        "series-resistance",
        (ChangeSize("resistance", "ohm", 1.0, 2.5), ChangeSize("skin", "ohm", 0.1, 2.0)),
        _resistance,
        "A series resistance was put in: a contact, a resistor, thin wire.",
        "A series resistance is gone: a contact, a resistor, thin wire.",
    ),
    TwoPort(
        "series-coil",
        _COIL,
        lambda f, v: _series(coil(f, v)),
        "A coil was put in series.",
        "A coil in series was taken out.",
        possible=_is_coil,
    ),
    TwoPort(
        "shunt-inductance",
        _COIL,
        lambda f, v: _shunt(1 / coil(f, v)),
        "A coil was put across the terminals.",
        "A coil across the terminals was taken away.",
        possible=_is_coil,
    ),
    TwoPort(
        "series-capacitance",
        (ChangeSize("capacitance", "F", 1e-9, 2.5), ChangeSize("loss tangent", "1", 2e-3, 1.5)),
        lambda f, v: _series(1 / _capacitor(f, v)),
        "A capacitor was put in series.",
        "A capacitor in series was taken out.",
    ),
    TwoPort(
        "stray-capacitance",
        _CAPACITOR,
        lambda f, v: _shunt(_capacitor(f, v)),
        "A capacitance was put across the terminals: a capacitor, a jig, a cable.",
        "A capacitance across the terminals is gone: a capacitor, a jig, a cable.",
    ),
    TwoPort(
        "leakage",
        (ChangeSize("conductance", "S", 1e-5, 2.5),),
        lambda f, v: _shunt(np.full(f.size, v["conductance"], np.complex128)),
        "A conductance was put across the terminals: a resistor, moisture, flux.",
        "A conductance across the terminals is gone: a resistor, moisture, flux.",
    ),
    TwoPort(
        "cable",
        (
            ChangeSize("length", "m", 0.6, 1.2),
            ChangeSize("impedance", "ohm", 65.0, 0.35),
            ChangeSize("loss", "Np/m", 2e-3, 1.5),
        ),
        _line,
        "A length of cable was put between analyzer and device.",
        "A length of cable between analyzer and device was taken out.",
        derived=_of_line,
        possible=_is_cable,
    ),
)


def two_ports() -> tuple[TwoPort | Turned, ...]:
    """Return every element, inserted and removed; a scale factor; and inverted recordings."""
    both = [replace(one, taken=taken, odds=one.odds / 2) for one in _ELEMENTS for taken in (False, True)]
    scale = TwoPort(
        "gain",
        (ChangeSize("ln gain", "1", 0.0, 0.3, signed=True),),
        _gain,
        "All of Z is larger or smaller by one factor: a gain, a wrong range, the area of the device.",
        "",
        odds=0.03,
    )
    turns = [Turned(kind=kind) for kind in ("inverted", "conjugated", "inverted and conjugated")]
    return (*both, scale, *turns)
