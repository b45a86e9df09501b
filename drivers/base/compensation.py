"""What a fixture adds, as an analyzer measured it."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from ...models.base.arrays import Complexes

Standard = Literal["open", "short", "load"]


@dataclass(frozen=True, eq=False)
class Compensation:
    """What a fixture adds, as the instrument measured it."""

    arrays: Mapping[Standard, Complexes]
    """At the instrument's own points, lowest frequency first: open in siemens (G + jB), short and load in ohm."""
    adapter: str
    """One of `Capabilities.adapters`; the arrays hold for it alone."""
    taken: str
    """When, RFC 3339, UTC."""
    instrument: str
    """Answer to `*IDN?`; the arrays hold for it alone."""
    fixture: str = ""
    """What people call the fixture that it was measured in."""
