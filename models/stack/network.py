"""A stack as a network: the pressure and velocity at every interface per unit of terminal current.

Interface k is the back face of section k, interface n the front load. First the impedances that each interface sees
towards the back and towards the front, then the velocities that the piezoelectric layers send out. Velocities count
towards the front; everything is per unit area, the terminal current included.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol, TypeGuard

import numpy as np

from ..arrays import Complexes
from .active import ActiveLine
from .laws import ComplexLike


class Section(Protocol):
    """A layer at all frequencies, as the network sees it."""

    def seen(self, load: ComplexLike) -> Complexes:
        """Return the impedance of one face in Rayl, with `load` (Rayl) at the other."""
        ...

    def passed(self, load: ComplexLike) -> ComplexLike:
        """Return the velocity of the far face, which carries `load`, per velocity of the near face."""
        ...

    def weights(self, v1: ComplexLike, F1: ComplexLike, v2: ComplexLike, F2: ComplexLike) -> dict[str, Complexes]:
        """Return d Z_el / d ln(quantity) in ohm m2 from the field at the faces."""
        ...


def is_active(section: Section) -> TypeGuard[ActiveLine]:
    """Return whether the section is piezoelectric."""
    return isinstance(section, ActiveLine)


@dataclass(frozen=True)
class Field:
    """Velocity (m/s) and pressure (Pa) at every interface, per unit of terminal current density."""

    v: list[ComplexLike]
    F: list[ComplexLike]


class Network:
    """The sections between two loads, back to front, with at least one of them piezoelectric."""

    def __init__(self, sections: Sequence[Section], back: ComplexLike, front: ComplexLike, parallel: bool) -> None:
        self.sections = sections
        self.parallel = parallel
        self.active = [k for k, section in enumerate(sections) if is_active(section)]
        first, last = self.active[0], self.active[-1]
        self.backward: dict[int, ComplexLike] = {0: back}
        for k in range(last):
            self.backward[k + 1] = sections[k].seen(self.backward[k])
        self.forward: dict[int, ComplexLike] = {len(sections): front}
        for k in range(len(sections) - 1, first, -1):
            self.forward[k] = sections[k].seen(self.forward[k + 1])
        self.sources = {k: self._piezo(k).radiates(self.backward[k], self.forward[k + 1]) for k in self.active}
        self.currents, self.Z = self._terminals()

    def _piezo(self, k: int) -> ActiveLine:
        section = self.sections[k]
        assert is_active(section)  # noqa: S101 - `active` holds nothing else
        return section

    def _terminals(self) -> tuple[dict[int, ComplexLike], Complexes]:
        """Return the current density of each piezoelectric layer per terminal current, and the impedance in ohm m2."""
        if len(self.active) == 1:
            k = self.active[0]
            return {k: 1.0 + 0j}, self._piezo(k).self_impedance(*self.sources[k])
        ports = self._ports()
        if not self.parallel:
            return dict.fromkeys(self.active, 1.0 + 0j), ports.sum(axis=(1, 2))
        ones = np.ones((*ports.shape[:2], 1))
        shares = np.linalg.solve(ports, ones)[:, :, 0]
        Z = 1.0 / shares.sum(axis=1)
        return {k: shares[:, i] * Z for i, k in enumerate(self.active)}, Z

    def _ports(self) -> Complexes:
        """Return the impedance matrix of the layers as separate ports, ohm m2, shape (N, m, m)."""
        m = len(self.active)
        size = np.shape(self.sources[self.active[0]][0])[0]
        ports = np.empty((size, m, m), np.complex128)
        for i, k in enumerate(self.active):
            ports[:, i, i] = self._piezo(k).self_impedance(*self.sources[k])
            travelling: ComplexLike = -self.sources[k][1]
            for j in range(i + 1, m):
                target = self.active[j]
                for between in range(self.active[j - 1] + 1, target):
                    travelling = travelling * self.sections[between].passed(self.forward[between + 1])
                heard = self._piezo(target).hears(self.forward[target + 1]) * travelling
                ports[:, i, j] = ports[:, j, i] = heard
                travelling = travelling * self.sections[target].passed(self.forward[target + 1])
        return ports

    def field(self) -> Field:
        """Return velocity and pressure at every interface."""
        n, first, last = len(self.sections), self.active[0], self.active[-1]
        rightward: dict[int, ComplexLike] = {}
        for k in range(first, n):
            out: ComplexLike = -self.sources[k][1] * self.currents[k] if k in self.sources else 0j
            if k > first:
                out = out + self.sections[k].passed(self.forward[k + 1]) * rightward[k]
            rightward[k + 1] = out
        leftward: dict[int, ComplexLike] = {}
        for k in range(last, -1, -1):
            out = self.sources[k][0] * self.currents[k] if k in self.sources else 0j
            if k < last:
                out = out + self.sections[k].passed(self.backward[k]) * leftward[k + 1]
            leftward[k] = out
        v: list[ComplexLike] = []
        F: list[ComplexLike] = []
        for k in range(n + 1):
            from_back, from_front = rightward.get(k), leftward.get(k)
            if from_front is None and from_back is not None:
                v.append(from_back)
                F.append(self.forward[k] * from_back)
            elif from_back is None and from_front is not None:
                v.append(from_front)
                F.append(-self.backward[k] * from_front)
            elif from_back is not None and from_front is not None:
                v.append(from_back + from_front)
                F.append(self.forward[k] * from_back - self.backward[k] * from_front)
        return Field(v, F)
