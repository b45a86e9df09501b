"""Loss laws: continuation of a lossy constant from its reference frequency to others.

A lossy constant is one complex number `M = M' + jM''` at the reference frequency. Its loss tangent `M''/M'` is positive
for a stiffness (1/Q) and negative for a permittivity (-tan d); every law below applies to both. A law with arbitrary
loss and a constant real part is not causal (Q = 80 requires c' to rise by 0.88 % from f to 3f); the other laws contain
the Kramers-Kronig companion, without an additional constant.
"""

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Literal, Self, TypeAlias

import numpy as np

from ..base.arrays import Complexes, Frequencies
from ..base.errors import PzctlError

ComplexLike: TypeAlias = complex | Complexes
"""One complex number for all frequencies, or an array of shape (N,)."""

LawKind: TypeAlias = Literal["elastic", "dielectric"]
"""What a law continues: stiffnesses or permittivities."""


class StackError(PzctlError):
    """A layer, load or stack that cannot exist, or an unknown parameter."""


def require_positive(owner: str, **values: float) -> None:
    """Raise StackError for a value that is not a positive finite number; a quality factor `q` may be infinite."""
    for name, value in values.items():
        if not (0 < value < math.inf or (name == "q" and value == math.inf)):
            what = f"{owner}: {name.replace('_', '.')} is {value:g}"
            raise StackError(f"{what}; a positive {'' if name == 'q' else 'finite '}number is needed")


class LossLaw(ABC):
    """A complex constant over frequency. A negative one (h33 seen from the other side) is minus its positive."""

    @abstractmethod
    def parameters(self) -> Mapping[str, float]:
        """Return the law's own parameters by name (`exponent`); empty if it has none."""

    @abstractmethod
    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the law with these parameters."""

    @abstractmethod
    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return the constant at frequencies in Hz, shape (N,), in the unit of `value`."""

    @abstractmethod
    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d constant / d `re`, `im` and each of the law's own parameters."""

    def log_derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d ln(constant) by the same; `value` must not be zero."""
        scale = 1 / self.over(value, frequency)
        return {key: size * scale for key, size in self.derivatives(value, frequency).items()}


@dataclass(frozen=True)
class ConstantLoss(LossLaw):
    """The same complex number at every frequency (hysteretic loss). Not causal, but used in most papers."""

    def parameters(self) -> Mapping[str, float]:
        """Return nothing: the law has no parameter."""
        return {}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the law itself: it has no parameter."""
        return self

    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return `value`."""
        return value

    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return 1 and j."""
        return {"re": 1.0 + 0j, "im": 1j}


@dataclass(frozen=True)
class CausalConstantQ(LossLaw):
    """Kjartansson's law (J. Geophys. Res. 84 (1979) 4737): M(f) = M (f/reference)^(2/pi atan(M''/M')).

    The loss tangent is the same at all frequencies, and the real part changes as causality requires: a stiffness rises
    with frequency, a permittivity falls.
    """

    reference: float
    """Frequency at which the constant has the given value, Hz."""

    def parameters(self) -> Mapping[str, float]:
        """Return nothing: causality fixes the dispersion."""
        return {}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the law itself: it has no parameter."""
        return self

    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return the constant at frequencies in Hz, shape (N,)."""
        return np.multiply((frequency / self.reference) ** _slope(value), value)

    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d M / d re and d M / d im, shape (N,)."""
        log_x = np.log(frequency / self.reference)
        stretch = np.exp(_slope(value) * log_x)
        turn = value / (abs(value) ** 2 or 1.0) * (2 / math.pi) * log_x  # nothing turns where there is nothing
        return {"re": stretch * (1 - value.imag * turn), "im": stretch * (1j + value.real * turn)}


def _slope(value: complex) -> float:
    """Return 2/pi times the loss angle, which is the exponent of frequency; the constant's sign does not matter."""
    return 2 / math.pi * math.atan2(math.copysign(1.0, value.real) * value.imag, abs(value.real))


@dataclass(frozen=True)
class PowerLoss(LossLaw):
    """Loss tangent proportional to f^exponent: M(f) = M' + M'' [cot(n pi/2) (x^n - 1) + j x^n], x = f/reference.

    This is the fractional Kelvin-Voigt solid M0 [1 + (jw tau)^n] (and, for n < 0, the universal dielectric response
    (jw)^n), written so that M is the value at the reference. Causal. n = 1 is the viscous law; n = 0 is its limit
    M' + M'' [(2/pi) ln x + j], the causal constant Q of small losses (for Q = 4 the stiffness would be negative below
    x = 0.002; use CausalConstantQ there). An attenuation ~ f^y corresponds to n = y - 1.
    """

    reference: float
    """Frequency at which the constant has the given value, Hz."""
    exponent: float
    """n, between -1 and 1."""

    def __post_init__(self) -> None:
        if not -1 <= self.exponent <= 1:
            raise StackError(f"power law of loss: exponent is {self.exponent:g}; allowed is -1 to 1")

    def parameters(self) -> Mapping[str, float]:
        """Return the exponent."""
        return {"exponent": self.exponent}

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the law with another exponent."""
        return replace(self, **values)

    def over(self, value: complex, frequency: Frequencies) -> ComplexLike:
        """Return the constant at frequencies in Hz, shape (N,)."""
        return value.real + value.imag * self._shape(np.log(frequency / self.reference))

    def derivatives(self, value: complex, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d M / d re, d im and d exponent, shape (N,) where they depend on frequency."""
        log_x = np.log(frequency / self.reference)
        by_exponent = value.imag * self._shape_by_exponent(log_x)
        return {"re": 1.0 + 0j, "im": self._shape(log_x), "exponent": by_exponent}

    def _shape(self, log_x: Frequencies) -> Complexes:
        """Return cot(n pi/2) (x^n - 1) + j x^n: the loss with its companion, 1j at the reference."""
        n = self.exponent
        if abs(n) < 1e-12:
            return np.add(2 / math.pi * log_x, 1j)
        return np.add(np.expm1(n * log_x) / math.tan(n * math.pi / 2), 1j * np.exp(n * log_x))

    def _shape_by_exponent(self, log_x: Frequencies) -> Complexes:
        """Return the derivative of `_shape` by n."""
        n = self.exponent
        if abs(n) < 1e-6:  # the two large terms below cancel; the series is exact to n^2 here
            companion = log_x**2 / math.pi + n * (2 / (3 * math.pi) * log_x**3 - math.pi / 3 * log_x)
            return np.add(companion, 1j * log_x * np.exp(n * log_x))
        power = np.exp(n * log_x)
        turn = -math.pi / 2 / math.sin(n * math.pi / 2) ** 2
        companion = turn * np.expm1(n * log_x) + log_x * power / math.tan(n * math.pi / 2)
        return np.add(companion, 1j * log_x * power)


def viscous(reference: float) -> PowerLoss:
    """Return the viscous law: Q = Q(reference) reference/f, with `reference` in Hz."""
    return PowerLoss(reference, 1.0)


CONSTANT = ConstantLoss()
"""The default law."""


def law_with(law: LossLaw, values: Mapping[str, float], prefix: str) -> LossLaw:
    """Return the law with those of its parameters that `values` contains under `prefix`."""
    own = {key: values[prefix + key] for key in law.parameters() if prefix + key in values}
    return law.replace(own) if own else law
