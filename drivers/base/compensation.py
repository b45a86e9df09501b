"""The compensation of a fixture, as measured by an analyzer."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ...models.base.arrays import Complexes

Standard = Literal["open", "short", "load"]


@dataclass(frozen=True, eq=False)
class Compensation:
    """The compensation of a fixture, as measured by the instrument."""

    arrays: Mapping[Standard, Complexes]
    """At the instrument's own points, lowest frequency first: open in siemens (G + jB), short and load in ohm."""
    adapter: str
    """One of `Capabilities.adapters`; the arrays are valid for this adapter only."""
    taken: str
    """Time of the measurement, RFC 3339, UTC."""
    instrument: str
    """Answer to `*IDN?`; the arrays are valid for this instrument only."""
    fixture: str = ""
    """Name of the fixture."""
