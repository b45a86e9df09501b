"""A stack as a network: pressure and velocity at every interface per unit of terminal current.

Interface k is the back face of section k, interface n the front load. First the impedances that each interface sees
towards the back and towards the front are computed, then the velocities caused by the piezoelectric layers. Velocities
count towards the front; everything is per unit area, including the terminal current.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from ..base.arrays import Complexes
from .active import ActiveLine
from .laws import ComplexLike


class Section(Protocol):
    """A layer at all frequencies, as an element of the network."""

    def input_impedance(self, load: ComplexLike) -> tuple[ComplexLike, ComplexLike]:
        """Return the input impedance of one face in Rayl with `load` (Rayl) at the other, and `share`."""
        ...

    def transmission(self, share: ComplexLike) -> ComplexLike:
        """Return the far face's velocity per velocity of the near face, from the second result of `input_impedance`."""
        ...

    def weights(self, v1: ComplexLike, F1: ComplexLike, v2: ComplexLike, F2: ComplexLike) -> dict[str, ComplexLike]:
        """Return d Z_el / d ln(quantity) in ohm m2 from the field at the faces."""
        ...


@dataclass(frozen=True, slots=True)
class Side:
    """Impedances that each interface sees in one direction."""

    Z: dict[int, ComplexLike]
    """Impedance in Rayl by interface."""
    share: dict[int, ComplexLike]
    """Input for `Section.transmission`, by the section that the wave passes."""


class Network:
    """The sections between two loads, back to front, at least one of them piezoelectric."""

    def __init__(self, sections: Sequence[Section], back: ComplexLike, front: ComplexLike, parallel: bool) -> None:
        self.sections = sections
        self.active = {k: section for k, section in enumerate(sections) if isinstance(section, ActiveLine)}
        self.first, self.last = min(self.active), max(self.active)
        self.backward, self.forward = Side({0: back}, {}), Side({len(sections): front}, {})
        for k in range(self.last):
            self.backward.Z[k + 1], self.backward.share[k] = sections[k].input_impedance(self.backward.Z[k])
        for k in range(len(sections) - 1, self.first, -1):
            self.forward.Z[k], self.forward.share[k] = sections[k].input_impedance(self.forward.Z[k + 1])
        self.sources = {
            k: piezo.face_velocities(self.backward.Z[k], self.forward.Z[k + 1]) for k, piezo in self.active.items()
        }
        self.currents, self.Z = self._terminals(parallel)

    def _terminals(self, parallel: bool) -> tuple[dict[int, ComplexLike], Complexes]:
        """Return the current density of each piezoelectric layer per terminal current, and the impedance in ohm m2."""
        if len(self.active) == 1:
            return {self.first: 1.0}, self.active[self.first].self_impedance(*self.sources[self.first])
        ports = self._ports()
        if not parallel:
            return dict.fromkeys(self.active, 1.0), ports.sum(axis=(-2, -1))
        shares = np.linalg.solve(ports, np.ones((*ports.shape[:-1], 1)))[..., 0]
        Z = 1.0 / shares.sum(axis=-1)
        return {k: shares[..., i] * Z for i, k in enumerate(self.active)}, Z

    def _ports(self) -> Complexes:
        """Return the impedance matrix of the piezoelectric layers as separate ports, ohm m2, shape (..., m, m)."""
        m, keys = len(self.active), list(self.active)
        shape = np.broadcast_shapes(*(np.shape(velocity) for pair in self.sources.values() for velocity in pair))
        ports = np.empty((*shape, m, m), np.complex128)
        for i, sender in enumerate(keys):
            ports[..., i, i] = self.active[sender].self_impedance(*self.sources[sender])
            travelling: ComplexLike = -self.sources[sender][1]
            for k in range(sender + 1, self.last + 1):
                share = self.forward.share[k]
                if k in self.active:
                    j = keys.index(k)
                    ports[..., i, j] = self.active[k].open_circuit_voltage(self.forward.Z[k + 1], share) * travelling
                    ports[..., j, i] = ports[..., i, j]
                travelling = travelling * self.sections[k].transmission(share)
        return ports

    def field(self) -> list[tuple[ComplexLike, ComplexLike]]:
        """Return velocity (m/s) and pressure (Pa) at every interface per unit of terminal current density."""
        to_front, to_back = self._sent_to_front(), self._sent_to_back()
        result: list[tuple[ComplexLike, ComplexLike]] = []
        for k in range(len(self.sections) + 1):
            if k not in to_back:
                result.append((to_front[k], self.forward.Z[k] * to_front[k]))
            elif k not in to_front:
                result.append((to_back[k], -self.backward.Z[k] * to_back[k]))
            else:
                pressure = self.forward.Z[k] * to_front[k] - self.backward.Z[k] * to_back[k]
                result.append((to_front[k] + to_back[k], pressure))
        return result

    def _sent_to_front(self) -> dict[int, ComplexLike]:
        """Return the velocity at every interface caused by the piezoelectric layers behind it."""
        sent: dict[int, ComplexLike] = {}
        for k in range(self.first, len(self.sections)):
            if k in sent:
                sent[k + 1] = sent[k] * self.sections[k].transmission(self.forward.share[k])
            if k in self.active:
                sent[k + 1] = sent.get(k + 1, 0.0) - self.sources[k][1] * self.currents[k]
        return sent

    def _sent_to_back(self) -> dict[int, ComplexLike]:
        """Return the velocity at every interface caused by the piezoelectric layers in front of it."""
        sent: dict[int, ComplexLike] = {}
        for k in range(self.last, -1, -1):
            if k + 1 in sent:
                sent[k] = sent[k + 1] * self.sections[k].transmission(self.backward.share[k])
            if k in self.active:
                sent[k] = sent.get(k, 0.0) + self.sources[k][0] * self.currents[k]
        return sent

    def weights(self, k: int, field: Sequence[tuple[ComplexLike, ComplexLike]]) -> dict[str, ComplexLike]:
        """Return d Z_el / d ln of the quantities of section k, ohm m2, from the result of `field`."""
        faces = *field[k], *field[k + 1]
        if k in self.active:
            return self.active[k].weights_driven(self.currents[k], *faces)
        return self.sections[k].weights(*faces)
