"""How an analyzer is found: what an entry point of the group `pzctl.analyzers` refers to."""

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

from .analyzer import Analyzer
from .capabilities import Capabilities

if TYPE_CHECKING:
    from ..visa.connection import Connection


@dataclass(frozen=True)
class InstrumentDriver:
    """An analyzer on a VISA path, found by its identification."""

    name: str
    """As a sentence lists it: `HP, Agilent or Keysight 4294A`."""
    idn: re.Pattern[str]
    """What its answer to `*IDN?` is, all of it."""
    capabilities: Callable[[str], Capabilities]
    """What the one with this identification can do; nothing is asked of it."""
    open: "Callable[[Connection], Analyzer]"
    """Return it; the connection is its own from then on."""
    assumed: bool = False
    """Whether a recording of unknown origin counts as one of this."""


@dataclass(frozen=True)
class PrefixDriver:
    """Something else that measures, found by how its resource begins."""

    name: str
    """As a sentence lists it: `a recording`."""
    prefix: str
    """Such as `recording:`."""
    open: Callable[[str], Analyzer]
    """Return it, by the resource without its prefix. Raises InstrumentError."""


Driver = InstrumentDriver | PrefixDriver
