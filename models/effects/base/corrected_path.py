"""Known errors of the path to the analyzer: impedances in series and admittances across the device, over frequency."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...base.arrays import Complexes, Frequencies, Impedances, Reals
from ...stack import Stack
from .assembly import Assembly
from .effect import TERMINALS, Effect, EffectParameter, Stage

SERIES, SHUNT = "series", "shunt"
"""Names of the two corrections."""
PATH = SERIES, SHUNT


@dataclass(frozen=True, eq=False)
class PathCorrection:
    """What a path adds at some frequencies, linear in ln f between them; the shunt is across the device."""

    log_f: Reals
    """Shape (K,), increasing."""
    values: Mapping[str, Complexes]
    """By `series` in ohm and `shunt` in siemens, shape (K,)."""

    def over(self, name: str, frequency: Frequencies) -> Complexes:
        """Return the series impedance or the shunt admittance at frequencies in Hz, shape (N,)."""
        if name not in self.values:
            return np.zeros(frequency.size, np.complex128)
        return np.asarray(np.interp(np.log(frequency), self.log_f, self.values[name]), np.complex128)


@dataclass(frozen=True, eq=False)
class CorrectedPath(Effect):
    """A device behind a known path; it has no parameters and is in no catalogue."""

    path: PathCorrection
    name: str = "~corrected-path"
    """Sorts behind all effects of its stage."""
    says: str = ""
    separates: ClassVar[str] = ""
    references: ClassVar[tuple[str, ...]] = ()
    stage: Stage = Stage.CABLE
    sizes: ClassVar[int] = 0

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the terminals."""
        return (TERMINALS,)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return none."""
        return ()

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device as seen through the path."""
        return assembly.behind(self._seen)

    def _seen(self, jw: Complexes, Z: Impedances) -> tuple[Impedances, Complexes]:
        f = jw.imag / (2 * np.pi)
        across = 1 / (1 + Z * self.path.over(SHUNT, f))
        return Z * across + self.path.over(SERIES, f), across**2
