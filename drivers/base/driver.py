"""Drivers, the objects that entry points of the group `pzctl.analyzers` refer to."""

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
    """An analyzer with a VISA resource, recognised by its identification."""

    name: str
    """Name for people: `HP, Agilent or Keysight 4294A`."""
    idn: re.Pattern[str]
    """Pattern of its complete answer to `*IDN?`."""
    capabilities: Callable[[str], Capabilities]
    """Return the capabilities for an identification, without asking the instrument."""
    open: "Callable[[Connection], Analyzer]"
    """Return the analyzer, which owns the connection from then on."""
    assumed: bool = False
    """Whether a recording of unknown origin is assumed to come from this analyzer."""


@dataclass(frozen=True)
class PrefixDriver:
    """Another source of measurements, recognised by the prefix of its resource."""

    name: str
    """Name for people: `a recording`."""
    prefix: str
    """Prefix of the resource, such as `recording:`."""
    open: Callable[[str], Analyzer]
    """Return the analyzer for the resource without its prefix. Raises InstrumentError."""


Driver = InstrumentDriver | PrefixDriver
