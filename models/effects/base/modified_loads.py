"""Loads made of another load: it keeps its parameters, and something is added to what it answers."""

from abc import abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ...base.arrays import Complexes, Frequencies
from ...stack import HalfSpace
from ...stack.laws import ComplexLike
from ...stack.loads import Load


@dataclass(frozen=True)
class ModifiedLoad(Load):
    """A load whose answer is a function of another one's, linear in it."""

    inner: Load

    def parameters(self) -> dict[str, float]:
        """Return those of the inner load."""
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
    """A face that moves something else as well: the impedances add."""

    support: Load

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the sum of both, Rayl."""
        return self.inner.impedance(frequency) + self.support.impedance(frequency)

    def factor(self, frequency: Frequencies) -> ComplexLike:
        """Return 1."""
        return 1.0


@dataclass(frozen=True)
class FiniteBackingLoad(ModifiedLoad):
    """A medium with a free rear: z sqrt(1 + j loss) (1 - e)/(1 + e), e = amplitude(f) exp(-jw delay) its echo.

    The amplitude is strength exp(decay (1 - f/reference)), as a medium of constant Q makes it, and stays below 1.
    """

    strength: float
    """At the reference; of a rear that is free and a medium with no loss it is 1."""
    delay: float
    """There and back, s."""
    decay: float
    """Attenuation there and back, that falls off linearly towards low frequency, Np at the reference."""
    reference: float
    """Hz."""
    loss: float
    """1/Q of the medium's stiffness, which turns its characteristic impedance."""

    def impedance(self, frequency: Frequencies) -> ComplexLike:
        """Return the specific impedance in Rayl, shape (N,)."""
        return self.inner.impedance(frequency) * self.factor(frequency)

    def factor(self, frequency: Frequencies) -> Complexes:
        """Return sqrt(1 + j loss) (1 - e)/(1 + e), shape (N,)."""
        amplitude = np.minimum(_MOST, self.strength * np.exp(self.decay * (1 - frequency / self.reference)))
        echo = amplitude * np.exp(-2j * np.pi * self.delay * frequency)
        return np.divide(1 - echo, 1 + echo, dtype=np.complex128) * np.sqrt(1 + 1j * self.loss)


_MOST = 0.999
"""Amplitude of an echo at most: at 1 the rear would come through at some frequencies as a wall without end."""


def is_backing(load: Load) -> bool:
    """Say whether a load is a solid or liquid taken as infinite."""
    return isinstance(load, HalfSpace) and load.z > _GAS


_GAS = 1e4
"""Rayl; above it no gas at ordinary pressure."""
