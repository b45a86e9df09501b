"""A stack as a network: pressure and velocity at every interface per unit of terminal current.

Interface k is the back face of section k, interface n the front load. First the impedances that each interface sees
towards the back and towards the front are computed, then the velocities caused by the piezoelectric layers. Velocities
count towards the front; everything is per unit area, including the terminal current.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, TypeAlias

import numpy as np

from ..base.arrays import Complexes
from .active import ActiveLine
from .loss_laws import ComplexLike


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


Field: TypeAlias = list[tuple[ComplexLike, ComplexLike, ComplexLike]]
"""Velocity of each interface, and the pressures behind and before it."""


@dataclass(frozen=True, slots=True)
class Side:
    """Impedances that each interface sees in one direction."""

    Z: dict[int, ComplexLike]
    """Impedance in Rayl by interface."""
    share: dict[int, ComplexLike]
    """Input for `Section.transmission`, by the section that the wave passes."""


@dataclass(frozen=True, slots=True)
class Path:
    """A massless spring from one interface to another, parallel to what lies between them."""

    behind: int
    """Interface of its back end."""
    before: int
    """Interface of its front end."""
    y: ComplexLike
    """Velocity difference per pressure, 1/Rayl."""


class Network:
    """The sections between two loads, back to front, at least one of them piezoelectric."""

    def __init__(
        self,
        sections: Sequence[Section],
        back: ComplexLike,
        front: ComplexLike,
        parallel: bool,
        path: Path | None = None,
    ) -> None:
        self.sections, self.path = sections, path
        electroded = {k: section for k, section in enumerate(sections) if isinstance(section, ActiveLine)}
        # In series, a layer that is not poled only adds its clamped impedance: no current moves it.
        poled = {k: section for k, section in electroded.items() if parallel or section.poled}
        self.active = poled or electroded
        self.unpoled = {k: section for k, section in electroded.items() if k not in self.active}
        self.first, self.last = min(self.active), max(self.active)
        self.backward, self.forward = Side({0: back}, {}), Side({len(sections): front}, {})
        ends = (self.first + 1, self.last) if path is None else (path.behind, path.before)
        for k in range(max(self.last, ends[1])):
            self.backward.Z[k + 1], self.backward.share[k] = sections[k].input_impedance(self.backward.Z[k])
        for k in range(len(sections) - 1, min(self.first, ends[0] - 1), -1):
            self.forward.Z[k], self.forward.share[k] = sections[k].input_impedance(self.forward.Z[k + 1])
        self.sources = {
            k: piezo.face_velocities(self.backward.Z[k], self.forward.Z[k + 1]) for k, piezo in self.active.items()
        }
        self.currents, self.Z = self._terminals(parallel)

    def _terminals(self, parallel: bool) -> tuple[dict[int, ComplexLike], Complexes]:
        """Return the current density of each piezoelectric layer per terminal current, and the impedance in ohm m2."""
        clamped: Complexes | float = sum((section.W for section in self.unpoled.values()), 0.0)
        if len(self.active) == 1 and self.path is None:
            return {self.first: 1.0}, clamped + self.active[self.first].self_impedance(*self.sources[self.first])
        if not parallel and self.path is None:
            return dict.fromkeys(self.active, 1.0), clamped + self._in_series()
        ports = self._ports()
        if self.path is not None:
            # The path takes up part of the motion t that each current causes between its ends.
            t = np.stack(np.broadcast_arrays(*(self._across(self.path, k) for k in self.active)), axis=-1)
            soft = np.asarray(self._softness(self.path))
            ports = ports + t[..., :, None] * t[..., None, :] / soft[..., None, None]
        if not parallel:
            return dict.fromkeys(self.active, 1.0), clamped + ports.sum(axis=(-2, -1))
        shares = np.linalg.solve(ports, np.ones((*ports.shape[:-1], 1)))[..., 0]
        Z = 1.0 / shares.sum(axis=-1)
        return {k: shares[..., i] * Z for i, k in enumerate(self.active)}, Z

    def _in_series(self) -> Complexes:
        """Return the impedance of the piezoelectric layers with one current, ohm m2: by reciprocity, twice one way."""
        total = sum(section.self_impedance(*self.sources[k]) for k, section in self.active.items())
        travelling: ComplexLike = -self.sources[self.first][1]
        for k in range(self.first + 1, self.last + 1):
            share, passed = self.forward.share[k], travelling
            travelling = travelling * self.sections[k].transmission(share)
            if k in self.active:
                total = total + 2.0 * self.active[k].open_circuit_voltage(self.forward.Z[k + 1], share) * passed
                travelling = travelling - self.sources[k][1]
        return np.asarray(total)

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

    def _across(self, path: Path, k: int) -> ComplexLike:
        """Return the velocity between the ends of the path, were it not there, per current of section k."""
        v1, v2 = self.sources[k]

        def at(interface: int) -> ComplexLike:
            return -v2 * self._passed(k + 1, interface) if interface > k else v1 * self._passed(k, interface)

        return at(path.behind) - at(path.before)

    def _softness(self, path: Path) -> ComplexLike:
        """Return the velocity between the ends per pressure of the path, with its own compliance, 1/Rayl."""
        i, j = path.behind, path.before
        return path.y + self._moved(i) + self._moved(j) - 2.0 * self._moved(i) * self._passed(i, j)

    def _moved(self, interface: int) -> ComplexLike:
        """Return the velocity of an interface per pressure applied to it, 1/Rayl."""
        return 1.0 / (self.backward.Z[interface] + self.forward.Z[interface])

    def _passed(self, start: int, end: int) -> ComplexLike:
        """Return the velocity of interface `end` per velocity of `start` of a wave that is sent from there."""
        ratio: ComplexLike = 1.0
        for k in range(start, end):
            ratio = ratio * self.sections[k].transmission(self.forward.share[k])
        for k in range(start - 1, end - 1, -1):
            ratio = ratio * self.sections[k].transmission(self.backward.share[k])
        return ratio

    @cached_property
    def _squeeze(self) -> ComplexLike:
        """Pressure of the path on its ends, per terminal current density; 0 without a path."""
        if self.path is None:
            return 0.0
        free: ComplexLike = sum((self._across(self.path, k) * current for k, current in self.currents.items()), 0j)
        return free / self._softness(self.path)

    @property
    def path_weight(self) -> ComplexLike:
        """Derivative d Z_el / d ln(stiffness of the path), ohm m2."""
        return 0.0 if self.path is None else self._squeeze * self._squeeze * self.path.y

    def field(self) -> Field:
        """Return velocity (m/s) and pressures (Pa) at every interface per unit of terminal current density.

        The two pressures are those behind and before the interface; they differ at the ends of a path only.
        """
        to_front, to_back = self._sent_to_front(), self._sent_to_back()
        result: Field = []
        for k in range(len(self.sections) + 1):
            if k not in to_back:
                velocity, pressure = to_front[k], self.forward.Z[k] * to_front[k]
            elif k not in to_front:
                velocity, pressure = to_back[k], -self.backward.Z[k] * to_back[k]
            else:
                velocity = to_front[k] + to_back[k]
                pressure = self.forward.Z[k] * to_front[k] - self.backward.Z[k] * to_back[k]
            result.append((velocity, pressure, pressure))
        if self.path is not None:
            result = self._pushed(result, self.path.behind, -self._squeeze)
            result = self._pushed(result, self.path.before, self._squeeze)
        return result

    def _pushed(self, field: Field, at: int, push: ComplexLike) -> Field:
        """Return the field with a pressure applied to an interface towards the front, beside the currents."""
        pushed: Field = []
        for k, (velocity, behind, before) in enumerate(field):
            more = push * self._moved(at) * self._passed(at, k)
            if k != at:
                pressure = self.forward.Z[k] * more if k > at else -self.backward.Z[k] * more
                pushed.append((velocity + more, behind + pressure, before + pressure))
            else:
                pushed.append((velocity + more, behind - self.backward.Z[k] * more, before + self.forward.Z[k] * more))
        return pushed

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

    def weights(self, k: int, field: Field) -> dict[str, ComplexLike]:
        """Return d Z_el / d ln of the quantities of section k, ohm m2, from the result of `field`."""
        (v1, _, F1), (v2, F2, _) = field[k], field[k + 1]
        faces = v1, F1, v2, F2
        if k in self.active:
            return self.active[k].weights_driven(self.currents[k], *faces)
        if k in self.unpoled:
            return self.unpoled[k].weights_driven(1.0, *faces)
        return self.sections[k].weights(*faces)
