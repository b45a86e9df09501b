"""Known smooth corrections of the constants of layers, as functions of frequency."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import ClassVar, Self

import numpy as np

from ...base.arrays import Complexes, Frequencies, Reals
from ...stack import Elastic, LossLaw, Piezo, Stack
from ...stack.loss_laws import ComplexLike
from ...stack.stack import Layer
from .assembly import Assembly
from .corrected_path import PathCorrection
from .effect import Effect, EffectParameter, Stage
from .modified_laws import Multiple

EVERYWHERE = "layers"
_LAWS = {"c33D": "c_law", "h33": "h_law", "eps33S": "eps_law"}
_OF_WAVES = "z", "c"


def corrected_in(layer: Layer) -> tuple[str, ...]:
    """Return the full names of a layer's constants that can be corrected."""
    own = tuple(_LAWS) if isinstance(layer, Piezo) else _OF_WAVES if isinstance(layer, Elastic) else ()
    return tuple(f"{layer.name}.{constant}" for constant in own)


@dataclass(frozen=True, eq=False)
class Corrections:
    """Relative corrections of constants at some frequencies, linear in ln f between them, and those of the path."""

    log_f: Reals
    """Shape (K,), increasing."""
    relative: Mapping[str, Complexes]
    """By constant (`disk.c33D`), shape (K,)."""
    paths: Mapping[str, PathCorrection] = field(default_factory=dict[str, PathCorrection])
    """By gluing step: what its path to the analyzer adds."""
    held: Mapping[str, float] = field(default_factory=dict[str, float])
    """Changes of ln value of values that a fit holds as exact, by name."""
    _factors: dict[tuple[str, int], tuple[Frequencies, Complexes]] = field(
        default_factory=dict[tuple[str, int], tuple[Frequencies, Complexes]]
    )
    """Factors at the frequencies of recordings, by name and identity: a model asks for them many times."""

    def factor(self, name: str, frequency: Frequencies) -> Complexes:
        """Return the factor of one constant at frequencies in Hz, shape (N,)."""
        known = self._factors.get((name, id(frequency)))
        if known is not None and known[0] is frequency:
            return known[1]
        made = 1 + self.over(name, frequency)
        if not frequency.flags.writeable:
            self._factors[name, id(frequency)] = frequency, made
        return made

    def over(self, name: str, frequency: Frequencies) -> Complexes:
        """Return the correction of one constant at frequencies in Hz, shape (N,)."""
        return np.asarray(np.interp(np.log(frequency), self.log_f, self.relative[name]), np.complex128)


@dataclass(frozen=True, eq=False)
class _Corrected(Multiple):
    corrections: Corrections
    name: str

    def factor_at(self, frequency: Frequencies) -> Complexes:
        """Return the factor at frequencies in Hz, shape (N,)."""
        return self.corrections.factor(self.name, frequency)


@dataclass(frozen=True)
class _CorrectedElastic(Elastic):
    """A passive layer whose impedance and speed are multiplied by known factors."""

    corrections: Corrections = field(kw_only=True, compare=False)

    @classmethod
    def of(cls, layer: Elastic, corrections: Corrections) -> Self:
        """Return a layer with corrections."""
        return cls(layer.name, layer.thickness, layer.z, layer.c, layer.q, layer.law, corrections=corrections)

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the layer with these parameters."""
        plain = Elastic(self.name, self.thickness, self.z, self.c, self.q, self.law)
        return self.of(plain.replace(values), self.corrections)

    def wave(self, frequency: Frequencies) -> tuple[ComplexLike, ComplexLike]:
        """Return the characteristic impedance (Rayl) and the travel time t/v (s) of a wave through the layer."""
        Zc, theta = super().wave(frequency)
        return Zc * self._factor("z", frequency), theta / self._factor("c", frequency)

    def _factor(self, constant: str, frequency: Frequencies) -> ComplexLike:
        name = f"{self.name}.{constant}"
        return self.corrections.factor(name, frequency) if name in self.corrections.relative else 1.0


@dataclass(frozen=True, eq=False)
class CorrectedConstants(Effect):
    """Constants of layers times known factors; it has no parameters and is in no catalogue."""

    corrections: Corrections
    name: str = "~corrected-constants"
    """Sorts behind all effects of its stage."""
    says: str = ""
    separates: ClassVar[str] = ""
    references: ClassVar[tuple[str, ...]] = ()
    stage: Stage = Stage.CONSTANTS
    sizes: ClassVar[int] = 0

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the only place, all layers."""
        return (EVERYWHERE,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return none."""
        return ()

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the corrected constants."""
        return assembly.each_stack(lambda stack: replace(stack, layers=tuple(map(self._corrected, stack.layers))))

    def _corrected(self, layer: Layer) -> Layer:
        known = self.corrections.relative
        if isinstance(layer, Elastic) and any(name in known for name in corrected_in(layer)):
            return _CorrectedElastic.of(layer, self.corrections)
        if not isinstance(layer, Piezo):
            return layer
        laws: dict[str, LossLaw] = {}
        for constant, law in _LAWS.items():
            name = f"{layer.name}.{constant}"
            if name in self.corrections.relative:
                laws[law] = _Corrected(getattr(layer, law), self.corrections, name)
        return replace(layer, **laws) if laws else layer
