"""Equivalent circuits: Butterworth-Van Dyke with any number of branches.

    o--[series.R]--[series.L]--+-------+-----------------+------ ...
                               |       |                 |
                             C0 (1 - j C0.tan_delta)   branch1: R - L - C   branch2 ...
    o--------------------------+-------+-----------------+------ ...

A branch is one resonance: IEEE Std 177-1966; several of them describe a device whose geometry is not known.
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np

from ..base.arrays import Complexes, Frequencies, Impedances, j_omega
from ..base.errors import PzctlError
from ..base.names import require


class LumpedError(PzctlError):
    """A circuit element with an impossible value."""


@dataclass(frozen=True)
class Branch:
    """A series resonance."""

    R: float
    """ohm."""
    L: float
    """H."""
    C: float
    """F."""

    @classmethod
    def from_resonance(cls, fs: float, Q: float, C: float) -> Self:
        """Return the branch that resonates at `fs` (Hz) with quality `Q` and capacitance `C` (F)."""
        w = 2 * math.pi * fs
        return cls(R=1 / (w * C * Q), L=1 / (w**2 * C), C=C)

    @property
    def fs(self) -> float:
        """Series resonance, Hz."""
        return 1 / (2 * math.pi * math.sqrt(self.L * self.C))

    @property
    def Q(self) -> float:
        """Quality factor; infinite without loss."""
        return math.sqrt(self.L / self.C) / self.R if self.R else math.inf


@dataclass(frozen=True)
class Lumped:
    """A lossy capacitor in parallel with resonant branches, and R and L in series. Satisfies `Model`."""

    C0: float
    """Clamped capacitance, F."""
    branches: tuple[Branch, ...] = ()
    tan_delta: float = 0.0
    """Loss tangent of C0, the same at all frequencies."""
    R: float = 0.0
    """In series with everything, ohm."""
    L: float = 0.0
    """In series with everything, H."""

    def __post_init__(self) -> None:
        for name, value in self.parameters().items():
            needed = name == "C0" or (name.endswith((".L", ".C")) and name.startswith("branch"))
            if not math.isfinite(value) or (needed and value <= 0):
                allowed = "a positive number" if needed else "a finite number"
                raise LumpedError(f"equivalent circuit: {name} is {value:g}; {allowed} is needed")

    def parameters(self) -> dict[str, float]:
        """Return `C0` (F), `C0.tan_delta`, `series.R` (ohm), `series.L` (H), `branch1.R`, `branch1.L`, ..."""
        own = {"C0": self.C0, "C0.tan_delta": self.tan_delta, "series.R": self.R, "series.L": self.L}
        for k, branch in enumerate(self.branches, 1):
            own |= {f"branch{k}.R": branch.R, f"branch{k}.L": branch.L, f"branch{k}.C": branch.C}
        return own

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the circuit with these parameters. Raises KeyError for an unknown name."""
        own = self.parameters()
        require(values, own, "the equivalent circuit")
        new = own | dict(values)
        branches = tuple(
            Branch(new[f"branch{k}.R"], new[f"branch{k}.L"], new[f"branch{k}.C"])
            for k in range(1, len(self.branches) + 1)
        )
        return replace(
            self,
            C0=new["C0"],
            branches=branches,
            tan_delta=new["C0.tan_delta"],
            R=new["series.R"],
            L=new["series.L"],
        )

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return Z in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        jw = j_omega(frequency)
        Y = jw * self.C0 * (1 - 1j * self.tan_delta)
        motional = sum((1 / _series(branch, jw) for branch in self.branches), start=np.zeros_like(jw))
        return self.R + jw * self.L + 1 / (Y + motional)

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N). Raises KeyError for an unknown name."""
        require(names, self.parameters(), "the equivalent circuit")
        jw = j_omega(frequency)
        Z = self.impedance(frequency)
        slopes = self._slopes(jw, (Z - self.R - jw * self.L) ** 2)
        return Z, np.array([slopes[name] / Z for name in names], np.complex128).reshape(len(names), frequency.size)

    def _slopes(self, jw: Complexes, Z2: Complexes) -> dict[str, Complexes]:
        """Return dZ/dp for every parameter; `Z2` is 1/Y^2 of all that is in parallel, because dZ = -dY/Y^2."""
        made = {
            "C0": -Z2 * jw * (1 - 1j * self.tan_delta),
            "C0.tan_delta": Z2 * jw * 1j * self.C0,
            "series.R": np.ones_like(jw),
            "series.L": jw,
        }
        for k, branch in enumerate(self.branches, 1):
            through = Z2 / _series(branch, jw) ** 2
            made |= {f"branch{k}.R": through, f"branch{k}.L": through * jw}
            made[f"branch{k}.C"] = -through / (jw * branch.C**2)
        return made


def _series(branch: Branch, jw: Complexes) -> Complexes:
    return branch.R + jw * branch.L + 1 / (jw * branch.C)
