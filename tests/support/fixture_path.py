"""The electrical path around a device, and the corrections that remove it.

    analyzer - load - short - open - cable - stray - lead - device

`lead` and `stray` belong to the device's wires; `cable` is an uncompensated length of line; `open`, `short` and `load`
are the residuals of an open/short/load compensation.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from typing import Any, Self

import numpy as np

from pzctl.models.base.arrays import Complexes, Frequencies, Impedances
from pzctl.models.base.model import Model
from pzctl.models.base.names import require
from pzctl.models.circuits.terminals import Scale, Seen, Series, Shunt, TransmissionLine

PATH = ("lead", "stray", "cable", "open", "short", "load")
"""Names of the elements, from the device to the analyzer."""


@dataclass(frozen=True)
class Fixture:
    """A device behind an electrical path. Satisfies `Model`.

    Parameters are those of the device and, for each element, `noun.field`: `lead.inductance` (H),
    `lead.resistance` (ohm), `lead.skin` (ohm at 1 MHz), `stray.capacitance` (F), `stray.conductance` (S),
    `cable.length` (m), `cable.impedance` (ohm), `cable.velocity` (m/s), `cable.loss` (Np/m at 1 MHz),
    `open.capacitance`, `open.conductance`, `short.inductance`, `short.resistance`, `short.skin`, `load.gain`,
    `load.delay` (s). By default the path is null and the device is measured directly.
    """

    device: Model
    lead: Series = field(default=Series())
    stray: Shunt = field(default=Shunt())
    cable: TransmissionLine = field(default=TransmissionLine())
    open: Shunt = field(default=Shunt())
    short: Series = field(default=Series())
    load: Scale = field(default=Scale())

    def parameters(self) -> dict[str, float]:
        """Return the device's parameters and those of the path."""
        return dict(self.device.parameters()) | self._path()

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return device and path with these parameters. Raises KeyError for an unknown name."""
        require(values, self.parameters(), "the device in its fixture")
        path = self._path()
        changes: dict[str, Any] = {
            "device": self.device.replace({name: value for name, value in values.items() if name not in path})
        }
        for noun in PATH:
            element = getattr(self, noun)
            own = {f.name: values[f"{noun}.{f.name}"] for f in fields(element) if f"{noun}.{f.name}" in values}
            changes[noun] = replace(element, **own)
        return replace(self, **changes)

    def impedance(self, frequency: Frequencies) -> Impedances:
        """Return the impedance at the analyzer in ohm, shape (N,), at frequencies in Hz, shape (N,)."""
        seen = self.device.impedance(frequency)
        for noun in PATH:
            seen, _, _ = self._see(noun, seen, frequency)
        return seen

    def jacobian(self, frequency: Frequencies, names: Sequence[str]) -> tuple[Impedances, Complexes]:
        """Return Z in ohm, shape (N,), and d ln Z / d parameter, shape (P, N). Raises KeyError for an unknown name."""
        require(names, self.parameters(), "the device in its fixture")
        path = self._path()
        inner = [name for name in names if name not in path]
        seen, rows = self.device.jacobian(frequency, inner)
        slopes = dict(zip(inner, rows * seen, strict=True))
        for noun in PATH:  # towards the analyzer: the impedance so far is transformed by the next element
            seen, through, own = self._see(noun, seen, frequency)
            slopes = {name: slope * through for name, slope in slopes.items()}
            slopes |= {f"{noun}.{key}": slope for key, slope in own.items()}
        made = np.array([slopes[name] / seen for name in names], np.complex128)
        return seen, made.reshape(len(names), frequency.size)

    def _see(self, noun: str, Z: Impedances, frequency: Frequencies) -> Seen:
        return getattr(self, noun).see(Z, frequency)

    def _path(self) -> dict[str, float]:
        return {
            f"{noun}.{f.name}": getattr(getattr(self, noun), f.name)
            for noun in PATH
            for f in fields(getattr(self, noun))
        }


def open_short_correction(measured: Impedances, opened: Impedances, shorted: Impedances) -> Impedances:
    """Return the device's impedance, shape (N,), from sweeps of the device, the open and the shorted fixture, ohm.

    For a fixture that is an impedance in series with the device and its shunt. Agilent, Impedance Measurement
    Handbook, writes 1/opened for 1/(opened - shorted), which holds where the short is small.
    """
    rest = measured - shorted
    return rest / (1 - rest / (opened - shorted))


def open_short_load_correction(
    measured: Impedances, opened: Impedances, shorted: Impedances, loaded: Impedances, standard: Impedances
) -> Impedances:
    """Return the device's impedance, shape (N,), ohm; `loaded` is the sweep of a known impedance `standard`.

    Exact for any linear, reciprocal or not, two-port between analyzer and device.
    """
    return standard * (opened - loaded) * (measured - shorted) / ((loaded - shorted) * (opened - measured))
