"""Laws of stiffness and permittivity that modify another law; at null they are that law."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...base.arrays import Complexes, Frequencies, Reals
from ...stack import ConstantLoss, Elastic, LossLaw, Piezo, Stack
from ...stack.loss_laws import ComplexLike
from ...stack.stack import Layer

_TINY = 1e-9


@dataclass(frozen=True)
class DerivedLaw(LossLaw):
    """A law with its parameters, derived from another one."""

    base: LossLaw

    def parameters(self) -> Mapping[str, float]:
        """Return the parameters of the base; those of the modification belong to an effect."""
        return self.base.parameters()

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the law with another base."""
        return replace(self, base=self.base.replace(values))


@dataclass(frozen=True)
class ModifiedLaw(DerivedLaw):
    """A law that is its base at one frequency."""

    reference: float
    """Frequency at which the modified law equals the base, Hz."""

    def _log_x(self, frequency: Frequencies) -> Reals:
        return np.log(frequency / self.reference)


@dataclass(frozen=True)
class LossExponent(ModifiedLaw):
    """M(f) = base + M'' [j (x^n - 1) + the stiffening that causality requires], x = f/reference.

    The loss M'' grows as x^n. Its Kramers-Kronig companion cot(n pi/2) (x^n - 1) (Szabo, J. Acoust. Soc. Am. 96 (1994)
    491; for n -> 0: (2/pi) ln x) has the weight `companion`: 1 is the causal law, 0 keeps the real part constant as
    most papers do. If the base is causal already, its own companion, (2/pi) ln x, is subtracted first.
    """

    exponent: float = 0.0
    companion: float = 0.0

    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return the constant at frequencies in Hz, shape (N,)."""
        return self.base.over(value, frequency) + value.imag * self._bend(frequency)

    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d constant / d `re`, `im` and the base's own parameters, shape (N,)."""
        slopes = dict(self.base.derivatives(value, frequency))
        slopes["im"] = slopes["im"] + self._bend(frequency)
        return slopes

    def _bend(self, frequency: Frequencies) -> Complexes:
        n, log_x = self.exponent, self._log_x(frequency)
        grown = np.expm1(n * log_x)
        partner = 2 / np.pi * log_x if abs(n) < _TINY else grown / np.tan(n * np.pi / 2)
        own = 0.0 if isinstance(self.base, ConstantLoss) else 2 / np.pi * log_x
        return np.add(self.companion * partner - own, 1j * grown)


@dataclass(frozen=True)
class GrainScatter(ModifiedLaw):
    """M(f) = base + M' loss [D(x) - Re D(1)]/Im D(1), D = -u^2/(1 - u^2 + j u/q), u = x/end, x = f/reference.

    Far below `end` the loss grows as x^3 and the stiffness falls as x^2, as the inertia of small grains does. With
    q = 2/pi it falls as the Kramers-Kronig relations say of a loss ~ x^3 that ends there. Causal and passive.
    """

    loss: float = 0.0
    """Loss tangent added at the reference."""
    end: float = 1.0
    """Where the loss ceases to grow."""

    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return the constant at frequencies in Hz, shape (N,)."""
        return self.base.over(value, frequency) + value.real * self._added(frequency)

    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d constant / d `re`, `im` and the base's own parameters, shape (N,)."""
        slopes = dict(self.base.derivatives(value, frequency))
        slopes["re"] = slopes["re"] + self._added(frequency)
        return slopes

    def _added(self, frequency: Frequencies) -> Complexes:
        at_one = complex(self._resonator(np.ones(1))[0])
        return self.loss * (self._resonator(frequency / self.reference) - at_one.real) / at_one.imag

    def _resonator(self, x: Reals) -> Complexes:
        u = x / self.end
        return np.divide(-u * u, 1 - u * u + 0.5j * np.pi * u, dtype=np.complex128)


@dataclass(frozen=True)
class Slope(ModifiedLaw):
    """eps(f) = x^(-slope) [eps' - j eps'' x^loss], x = f/reference: permittivity and loss tangent as power laws."""

    slope: float = 0.0
    loss: float = 0.0

    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return the constant at frequencies in Hz, shape (N,)."""
        return self._bent(self.base.over(value, frequency), frequency)

    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d constant / d `re`, `im` and the base's own parameters, shape (N,)."""
        slopes = self.base.derivatives(value, frequency)
        return {key: self._bent(size, frequency) for key, size in slopes.items()}

    def _bent(self, size: ComplexLike, frequency: Frequencies) -> Complexes:
        """Return the base's constant, or a real derivative of it, modified: linear in its real and imaginary part."""
        log_x = self._log_x(frequency)
        bent = np.real(size) + 1j * np.imag(size) * np.exp(self.loss * log_x)
        return np.multiply(np.exp(-self.slope * log_x), bent, dtype=np.complex128)


class Multiple(DerivedLaw):
    """A law times a factor for each frequency."""

    @abstractmethod
    def factor_at(self, frequency: Frequencies) -> Complexes:
        """Return the factor at frequencies in Hz, shape (N,)."""

    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return the constant at frequencies in Hz, shape (N,)."""
        return self.base.over(value, frequency) * self.factor_at(frequency)

    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d constant / d `re`, `im` and the base's own parameters, shape (N,)."""
        factor = self.factor_at(frequency)
        return {key: size * factor for key, size in self.base.derivatives(value, frequency).items()}


@dataclass(frozen=True)
class Relaxation(Multiple):
    """eps(f) [1 + s (D(x) - D(1))], D(x) = 1/(1 + j x/x_r), x = f/reference: a Debye relaxation of strength s."""

    reference: float
    """Frequency at which the modified law equals the base, Hz."""
    strength: float = 0.0
    at: float = 1.0
    """x_r, where the loss is largest."""

    def factor_at(self, frequency: Frequencies) -> Complexes:
        """Return the factor at frequencies in Hz, shape (N,)."""
        x = frequency / self.reference
        return np.asarray(1 + self.strength * (1 / (1 + 1j * x / self.at) - 1 / (1 + 1j / self.at)), np.complex128)


@dataclass(frozen=True)
class CoupledMode(Multiple):
    """c(f) [1 - s f_k^2/(f_k^2 - f^2 + j f f_k/Q)]: a mode that the strain drives."""

    strength: float
    frequency: float
    """f_k, Hz."""
    q: float

    def factor_at(self, frequency: Frequencies) -> Complexes:
        """Return the factor at frequencies in Hz, shape (N,)."""
        jx = 1j * frequency / self.frequency
        return np.asarray(1 - self.strength / (1 + jx * jx + jx / self.q), np.complex128)


@dataclass(frozen=True)
class Factor(Multiple):
    """A law times given numbers, for a strain that depends on frequency."""

    factor: Complexes
    """Shape (N,), at the only frequencies at which the law can be evaluated."""

    def factor_at(self, frequency: Frequencies) -> Complexes:
        """Return the numbers, shape (N,)."""
        return self.factor


def with_stiffness_law(stack: Stack, name: str, change: Callable[[LossLaw], LossLaw]) -> Stack:
    """Return the stack with the law of one layer's stiffness changed; a layer without stiffness stays as it is."""

    def changed(layer: Layer) -> Layer:
        if layer.name != name:
            return layer
        if isinstance(layer, Piezo):
            return replace(layer, c_law=change(layer.c_law))
        return replace(layer, law=change(layer.law)) if isinstance(layer, Elastic) else layer

    return replace(stack, layers=tuple(map(changed, stack.layers)))


def with_piezo(stack: Stack, name: str, change: Callable[[Piezo], Piezo]) -> Stack:
    """Return the stack with one piezoelectric layer changed."""
    return replace(
        stack,
        layers=tuple(change(one) if one.name == name and isinstance(one, Piezo) else one for one in stack.layers),
    )
