"""Identifies a 4294A by its *IDN? reply; the package's entry point refers to this module."""

import re
from typing import TYPE_CHECKING

from ..base.driver import InstrumentDriver
from .capabilities import CAPABILITIES

if TYPE_CHECKING:
    from ..visa.connection import Connection
    from .instrument import Agilent4294A

# The manufacturer is HEWLETT-PACKARD even on Agilent's own units; later brand names are accepted too.
IDN = re.compile(r'"?(HEWLETT-PACKARD|AGILENT[^,]*|KEYSIGHT[^,]*), ?4294A, ?([^,]*), ?([^,"]*)"?', re.IGNORECASE)


def _opened(link: "Connection") -> "Agilent4294A":
    from .instrument import Agilent4294A  # imported late: it loads pyvisa, which is slow and not needed to plan a sweep

    return Agilent4294A(link)


DRIVER = InstrumentDriver("HP, Agilent or Keysight 4294A", IDN, lambda _: CAPABILITIES, _opened, assumed=True)
