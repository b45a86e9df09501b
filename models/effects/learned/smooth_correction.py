"""A correction of unknown law: any smooth causal function of frequency, as combinations of relaxations."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from ...base.arrays import Complexes, Frequencies, Reals
from ...stack import Stack
from ..base.assembly import Assembly
from ..base.effect import Effect, EffectParameter
from ..base.scale import resonance
from .corrections import CONSTANTS, Place, corrected

_SPACING = 0.35
"""Spacing of the relaxations in ln f; each extends over about 2."""
_BEYOND = np.log(8.0)
"""Range of relaxations beyond the recorded band, in ln f."""
_NODES = 80
_REMEMBERED = 8
"""Number of recordings whose functions are kept; a session has fewer."""
_KEPT = 0.003
"""Smallest kept standard deviation of a function, relative to the largest."""


@dataclass(frozen=True, eq=False)
class CausalBasis:
    """Orthogonal combinations of 1/(1 + j f/f_k), zero at the reference for a factor; of unit rms together."""

    poles: Reals
    """f_k, Hz, shape (K,)."""
    weights: Reals
    """Shape (K [+ 2], M); the last two are a constant and j f/f0, for a correction that adds an impedance."""
    reference: float
    added: bool
    _known: list[tuple[Frequencies, Complexes]] = field(default_factory=list[tuple[Frequencies, Complexes]])
    """Newest functions at the points of recordings, by their frequencies."""

    def over(self, frequency: Frequencies, coefficients: Reals) -> Complexes:
        """Return the function with these coefficients of unit normal prior, shape (N,)."""
        return self._functions(frequency) @ coefficients

    def taken(self, coefficients: Reals) -> complex:
        """Return what the complete function of a factor has at the reference."""
        return complex(_relaxations(np.array([self.reference]), self.poles)[0] @ self.weights @ coefficients)

    def _functions(self, frequency: Frequencies) -> Complexes:
        """Return every function at these frequencies, shape (N, M)."""
        for where, known in self._known:
            if where is frequency or np.array_equal(where, frequency):
                return known
        made = np.asarray(_terms(frequency, self.poles, self.reference, added=self.added) @ self.weights)
        self._known[:] = [(frequency.copy(), made), *self._known[: _REMEMBERED - 1]]
        return made


def _terms(frequency: Frequencies, poles: Reals, reference: float, *, added: bool) -> Complexes:
    made = _relaxations(frequency, poles)
    if not added:
        return np.asarray(made - _relaxations(np.array([reference]), poles), np.complex128)
    more = np.stack([np.ones(frequency.size), 1j * frequency / reference], axis=1)
    return np.asarray(np.concatenate([made, more], axis=1), np.complex128)


def _relaxations(frequency: Frequencies, poles: Reals) -> Complexes:
    return np.asarray(1 / (1 + 1j * frequency[:, None] / poles), np.complex128)


@lru_cache(maxsize=32)
def causal_basis(low: float, high: float, reference: float, *, added: bool) -> CausalBasis:
    """Return the smooth causal functions over a band in Hz."""
    u = np.arange(np.log(low) - _BEYOND, np.log(high) + _BEYOND, _SPACING)
    poles = np.exp(u)
    nodes = np.geomspace(low, high, _NODES)
    A = _terms(nodes, poles, reference, added=added)
    _, size, Vt = np.linalg.svd(np.concatenate([A.real, A.imag]), full_matrices=False)
    kept = size > _KEPT * size[0]
    scale = np.sqrt(_NODES / np.sum(size[kept] ** 2))
    return CausalBasis(poles, Vt[kept].T * scale, reference, added)


class SmoothCorrection(Effect):
    """A smooth causal correction at one place, with a given standard deviation."""

    name = "learned"
    says = "A correction of {where} that depends smoothly on frequency describes the misfit; its law is not known."
    separates = "a recording over a wider band, and of another sample"
    references = (
        "Kennedy and O'Hagan, J. R. Stat. Soc. B 63 (2001) 425: discrepancy as a random function",
        "Sargsyan, Najm and Ghanem, Int. J. Chem. Kinet. 47 (2015) 246: discrepancy embedded in the model",
    )

    def __init__(self, place: Place, size: float, band: tuple[float, float], stack: Stack, number: int = 1) -> None:
        """Make the effect; `band`: Hz; `number`: which of the learned effects at its place it is.

        The reference of a constant's correction is the resonance of `stack`.
        """
        self.place, self.size, self.number = place, size, number
        self.stage = place.stage
        self.basis = causal_basis(*band, resonance(stack), added=place.quantity not in CONSTANTS)
        """The functions of the correction."""

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return its place."""
        return (self.place.where,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the coefficients of the functions, in prior standard deviations."""
        count = self.basis.weights.shape[1]
        return tuple(
            EffectParameter(f"a{k}", "1", typical=1.0, lower=-30.0, upper=30.0, prior=(0.0, 1.0)) for k in range(count)
        )

    def added_losses(self, where: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the loss of the correction at its reference, if it corrects a constant."""
        if self.place.constant is None:
            return {}
        return {self.place.constant: self.size * self.basis.taken(self._coefficients(values)).imag}

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the correction."""
        a = self._coefficients(values)
        if not np.any(a):
            return assembly
        return corrected(assembly, self.place, lambda f: self.size * self.basis.over(f, a))

    def _coefficients(self, values: Mapping[str, float]) -> Reals:
        return np.array([values[f"a{k}"] for k in range(self.basis.weights.shape[1])])
