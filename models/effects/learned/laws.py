"""Laws that a correction may follow: causal and passive functions of frequency with a few parameters.

`x` is f/f0, f0 the reference (the half-wave resonance of the active layer). A correction of a constant is zero at the
reference, so that the constant keeps its meaning; a correction that adds an impedance or an admittance is the complete
quantity, in units of its natural size. Each is passive for sizes above zero.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Complexes, Reals
from ..base.effect import EffectParameter
from .corrections import CONSTANTS, Quantity

Values = Mapping[str, float]
_SIZE = 0.01, 2.0
"""Prior of a size: median and standard deviation of the logarithm."""
_Function = Callable[[Reals, Values], Complexes]


@dataclass(frozen=True, eq=False)
class Law:
    """A function of frequency with named parameters; the first is its size."""

    name: str
    parameters: tuple[EffectParameter, ...]
    of: Callable[[Reals, Values], Complexes]
    """Maps x, shape (N,), and the parameters to the function, shape (N,)."""
    says: str
    """Words, with `{what}` and the parameters by name."""
    taken: Callable[[Values], complex] | None = None
    """What the complete function has at the reference, which the correction of a constant does not contain; None for
    other quantities."""


def _size(name: str = "size", typical: float = 0.01) -> EffectParameter:
    return EffectParameter(name, "1", typical, prior=_SIZE)


def _at(name: str = "at", low: float = 1e-2, high: float = 100.0) -> EffectParameter:
    return EffectParameter(name, "1", typical=0.1, lower=low, upper=high, null=1.0)


def _shape(name: str, low: float, high: float, null: float) -> EffectParameter:
    return EffectParameter(name, "1", typical=0.1, lower=low, upper=high, null=null)


def _relaxed(x: Reals, at: float, spread: float, skew: float) -> Complexes:
    """Return Havriliak and Negami's function: Cole and Cole's for skew 1, Debye's if spread is 1 as well."""
    return np.asarray((1 + (1j * x / at) ** spread) ** -skew, np.complex128)


def _power(x: Reals, values: Values) -> Complexes:
    n = values["exponent"]
    return np.asarray(values["size"] / n * (1j * x) ** n, np.complex128)


def _falling_power(x: Reals, values: Values) -> Complexes:
    n = values["exponent"]
    return np.asarray(values["size"] / n * (1j * x) ** -n, np.complex128)


def _resonant(x: Reals, values: Values) -> Complexes:
    at, q = values["at"], values["q"]
    return np.asarray(values["size"] * at**2 / (at**2 - x**2 + 1j * x * at / q), np.complex128)


def _peaked(x: Reals, values: Values) -> Complexes:
    at, q = values["at"], values["q"]
    return np.asarray(values["size"] * (1j * x * at / q) / (at**2 - x**2 + 1j * x * at / q), np.complex128)


def _constant_phase(x: Reals, values: Values) -> Complexes:
    """Return an inertance, for an exponent near 1, whose loss angle is the same at all frequencies."""
    return np.asarray(values["size"] * (1j * x) ** values["exponent"], np.complex128)


def _falling_phase(x: Reals, values: Values) -> Complexes:
    return np.asarray(values["size"] * (1j * x) ** -values["exponent"], np.complex128)


def _line(x: Reals, values: Values) -> Complexes:
    root = np.sqrt(1j * x / values["at"])
    return np.asarray(values["size"] * np.tanh(root) / root, np.complex128)


def _crossed(x: Reals, values: Values) -> Complexes:
    """Return the impedance of a layer or a short-circuited line without loss: an inertance as far as it is thin."""
    phase = 2 * np.pi * x * values["transit"]
    return np.asarray(1j * x * values["size"] * np.tan(phase) / phase, np.complex128)


def _echo(x: Reals, values: Values) -> Complexes:
    echo = values["echo"] * np.exp(-2j * np.pi * x * values["delay"])
    return np.asarray(values["size"] * (1 - echo) / (1 + echo), np.complex128)


def _inner_echo(x: Reals, values: Values) -> Complexes:
    return _standing(values["size"] * np.exp(-2j * np.pi * x * values["delay"]))


def _fading_echo(x: Reals, values: Values) -> Complexes:
    """Return the factor of a medium of constant Q that ends free: attenuation ~ f, and what causality requires of c."""
    return _standing(values["size"] ** (x - 2j / np.pi * x * np.log(x)) * np.exp(-2j * np.pi * x * values["delay"]))


def _standing(echo: NDArray[np.inexact]) -> Complexes:
    return np.asarray(-2 * echo / (1 + echo), np.complex128)


_EXPONENT = _shape("exponent", 0.02, 0.95, 0.2)
_RISING = _shape("exponent", 0.02, 1.5, 0.2)
"""Of a stiffness: the loss of a viscous solid is proportional to frequency, and below 2 a power dissipates."""
_ELEMENT = _shape("exponent", 0.02, 0.998, 0.8)
"""Of a constant-phase element: 1 is an inertance or a spring without loss, 0 a resistance."""
_SPREAD, _SKEW = _shape("spread", 0.2, 1.0, 0.7), _shape("skew", 0.2, 1.0, 0.7)
_Q = _shape("q", 1.0, 300.0, 10.0)
_TRANSIT = EffectParameter("transit", "1", typical=0.01, lower=1e-3, upper=0.24, null=0.03)
_DELAY = _shape("delay", 0.2, 50.0, 2.0)


def laws(quantity: Quantity) -> tuple[Law, ...]:
    """Return the laws for a quantity, simplest first; none for a reading: an instrument follows no law of physics."""
    if quantity == "reading":
        return ()
    if quantity in CONSTANTS:
        return _of_constant(quantity)
    if quantity == "load":
        return _OF_LOAD
    if quantity == "series":
        return _IN_SERIES
    return _ADMITTED if quantity in ("shunt", "compliance") else _ADDED


def _of_constant(quantity: Quantity) -> tuple[Law, ...]:
    if quantity == "coupling":  # it dissipates nothing, so it may rise or fall
        return (*_with_sign(-1.0, _power, ""), *_with_sign(1.0, _falling_power, "-falling"))
    return _with_sign(-1.0, _power, "") if quantity == "stiffness" else _with_sign(1.0, _falling_power, "")


def _with_sign(sign: float, power: _Function, ending: str) -> tuple[Law, ...]:
    """Return the laws of a constant that rises (-1) or falls (1) with frequency."""

    def law(name: str, parameters: tuple[EffectParameter, ...], of: _Function, sign: float, says: str) -> Law:
        def taken(values: Values) -> complex:
            return sign * complex(of(np.ones(1), values)[0])

        def beyond(x: Reals, values: Values) -> Complexes:
            return np.asarray(sign * of(x, values) - taken(values), np.complex128)

        return Law(f"{name}{ending}", parameters, beyond, says, taken)

    def relaxation(x: Reals, values: Values) -> Complexes:
        return values["size"] * _relaxed(x, values["at"], values.get("spread", 1.0), values.get("skew", 1.0))

    exponent = _RISING if sign < 0 else _EXPONENT
    spread = "relaxes at {at} with strength {size} and a spread of times (Cole-Cole exponent {spread})"
    skewed = "relaxes at {at} with strength {size} (Havriliak-Negami exponents {spread} and {skew})"
    return (
        law("power", (_size(), exponent), power, 1.0, "follows a power law with exponent {exponent}"),
        law("debye", (_size(), _at()), relaxation, sign, "relaxes at {at} with strength {size}"),
        law("cole-cole", (_size(), _at(), _SPREAD), relaxation, sign, spread),
        law("havriliak-negami", (_size(), _at(), _SPREAD, _SKEW), relaxation, sign, skewed),
        law("resonance", (_size(), _at(), _Q), _resonant, sign, "resonates at {at} with strength {size} and Q {q}"),
    )


_ADDED = (
    Law("resistance", (_size(),), lambda x, v: np.full(x.size, v["size"], np.complex128), "a resistance of {size}"),
    Law("inertance", (_size(),), lambda x, v: np.asarray(1j * x * v["size"], np.complex128), "an inertance of {size}"),
    Law("compliance", (_size(),), lambda x, v: np.asarray(v["size"] / (1j * x), np.complex128), "a spring of {size}"),
    Law(
        "root",
        (_size(),),
        lambda x, v: np.asarray(v["size"] * np.sqrt(1j * x), np.complex128),
        "a part that grows as the root of frequency, {size}",
    ),
    Law(
        "constant-phase",
        (_size(), _ELEMENT),
        _constant_phase,
        "a part that grows as frequency to the power {exponent}, {size} at the reference, of constant phase",
    ),
    Law(
        "constant-phase-falling",
        (_size(), _ELEMENT),
        _falling_phase,
        "a part that falls as frequency to the power {exponent}, {size} at the reference, of constant phase",
    ),
    Law(
        "debye",
        (_size(), _at()),
        lambda x, v: np.asarray(v["size"] * _relaxed(x, v["at"], 1.0, 1.0), np.complex128),
        "{size} that relaxes at {at}",
    ),
    Law("line", (_size(), _at()), _line, "{size} spread along a line, from {at} on"),
    Law(
        "layer",
        (_size(), _TRANSIT),
        _crossed,
        "an inertance of {size} along a layer or line that waves cross in {transit}",
    ),
    Law("resonance", (_size(), _at(), _Q), _peaked, "a resonance at {at} of {size} and Q {q}"),
    Law(
        "echo",
        (_size(), _DELAY, _shape("echo", 0.01, 0.95, 0.3)),
        _echo,
        "{size} with an echo of {echo} after {delay}",
    ),
)

_OF_ADMITTANCE = {
    "resistance": "a conductance of {size}",
    "inertance": "a part that grows in proportion to frequency, {size} at the reference",
    "compliance": "a part that falls as 1/f, {size} at the reference",
    "layer": "a part that grows with frequency, {size} at the reference, along a line that waves cross in {transit}",
}
"""The same laws in words where an admittance is added: there a mass and a spring change their roles."""
_ADMITTED = tuple(replace(law, says=_OF_ADMITTANCE.get(law.name, law.says)) for law in _ADDED)
_SPREAD_OUT = "a resistance of {size} spread over an electrode or along a line, which falls from {at} on"
_IN_SERIES = tuple(replace(law, says=_SPREAD_OUT) if law.name == "line" else law for law in _ADDED)
_OF_LOAD = (
    Law(
        "echo",
        (EffectParameter("size", "1", 0.1, upper=0.95, prior=(0.2, 1.0)), _DELAY),
        _inner_echo,
        "an echo of {size} after {delay}",
    ),
    Law(
        "fading-echo",
        (EffectParameter("size", "1", 0.1, upper=0.95, prior=(0.2, 1.0)), _DELAY),
        _fading_echo,
        "an echo after {delay} that fades towards high frequency, {size} at the reference",
    ),
)
"""The load z becomes z (1 - e)/(1 + e), e the echo from the far end of a layer with the impedance of the load."""
