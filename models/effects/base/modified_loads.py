"""Loads derived from another load: they keep its parameters and modify its impedance."""

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...base.arrays import Complexes, Frequencies
from ...base.face_loads import FACES
from ...stack import HalfSpace, Stack
from ...stack.loads import Load
from ...stack.loss_laws import ComplexLike, PowerLoss


@dataclass(frozen=True)
class ModifiedLoad(Load):
    """A load whose impedance is a linear function of another one's."""

    inner: Load

    def parameters(self) -> dict[str, float]:
        """Return the parameters of the inner load."""
        return self.inner.parameters()

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return it around the inner load with these parameters."""
        return replace(self, inner=self.inner.replace(values))

    @abstractmethod
    def factor(self, frequency: Frequencies) -> ComplexLike:
        """Return d impedance / d inner impedance, shape (N,) or a number."""

    def gradients(self, frequency: Frequencies) -> Mapping[str, ComplexLike]:
        """Return d impedance / d parameter of the inner load."""
        factor = self.factor(frequency)
        return {key: size * factor for key, size in self.inner.gradients(frequency).items()}


@dataclass(frozen=True)
class SupportedLoad(ModifiedLoad):
    """A face that also moves something else: the impedances add."""

    support: Load

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the sum of both, Rayl."""
        return self.inner.impedance(frequency) + self.support.impedance(frequency)

    def factor(self, frequency: Frequencies) -> ComplexLike:
        """Return 1."""
        return 1.0


def resting_on(stack: Stack, face: str, support: Load) -> Stack:
    """Return the stack with something on a face, one of `FACES`, in addition to its load there."""
    if face == FACES[0]:
        return replace(stack, back=SupportedLoad(stack.back, support))
    return replace(stack, front=SupportedLoad(stack.front, support))


@dataclass(frozen=True)
class CorrectedLoad(ModifiedLoad):
    """A load times 1 + g(f)."""

    g: Callable[[Frequencies], Complexes]

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the specific impedance in Rayl, shape (N,)."""
        return self.inner.impedance(frequency) * self.factor(frequency)

    def factor(self, frequency: Frequencies) -> Complexes:
        """Return 1 + g, shape (N,)."""
        return 1 + self.g(frequency)


@dataclass(frozen=True)
class FiniteBackingLoad(ModifiedLoad):
    """A medium with a rear face: z sqrt(M) (1 - e)/(1 + e), M = 1 + loss S(f) its stiffness and e its echo.

    e = strength exp(decay (1 + j x S(f)) - jw delay), x = f/reference, and S the loss ~ f^exponent with its causal
    companion (`PowerLoss`). Its amplitude stays below 1.
    """

    strength: float
    """Amplitude at the reference frequency; 1 for a free rear face and a lossless medium."""
    delay: float
    """Round-trip delay, s."""
    decay: float
    """Round-trip attenuation at the reference, Np."""
    exponent: float
    """Power of frequency that the medium's 1/Q follows, between -1 and 1; the attenuation follows one more."""
    reference: float
    """Hz."""
    loss: float
    """1/Q of the medium's stiffness, which rotates its characteristic impedance."""

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the specific impedance in Rayl, shape (N,)."""
        return self.inner.impedance(frequency) * self.factor(frequency)

    def factor(self, frequency: Frequencies) -> Complexes:
        """Return sqrt(M) (1 - e)/(1 + e), shape (N,)."""
        lossy = PowerLoss(self.reference, self.exponent).over(1j, frequency)
        fading = self.decay * (1 + 1j * frequency / self.reference * lossy)
        amplitude = np.minimum(_MOST, self.strength * np.exp(np.minimum(fading.real, _LARGEST)))
        echo = amplitude * np.exp(1j * (fading.imag - 2 * np.pi * self.delay * frequency))
        return np.divide(1 - echo, 1 + echo, dtype=np.complex128) * np.sqrt(1 + self.loss * lossy)


_MOST = 0.999
"""Largest amplitude of an echo; at 1 the impedance would be infinite at some frequencies."""
_LARGEST = float(np.log(np.finfo(float).max))
"""Largest exponent without overflow."""


def is_backing(load: Load) -> bool:
    """Return whether a load is a solid or liquid treated as infinite."""
    return isinstance(load, HalfSpace) and load.z > _GAS


_GAS = 1e4
"""Rayl; no gas at ordinary pressure has more."""
