"""How a 4294A is found: by its identification, through the entry point of this package."""

import re
from typing import TYPE_CHECKING

from ..base.driver import InstrumentDriver
from .capabilities import CAPABILITIES

if TYPE_CHECKING:
    from ..visa.connection import Connection
    from .instrument import Agilent4294A

# String 1 was HEWLETT-PACKARD even on Agilent's own units; later badges are allowed for.
IDN = re.compile(r'"?(HEWLETT-PACKARD|AGILENT[^,]*|KEYSIGHT[^,]*), ?4294A, ?([^,]*), ?([^,"]*)"?', re.IGNORECASE)


def _opened(link: "Connection") -> "Agilent4294A":
    from .instrument import Agilent4294A  # with pyvisa, which who only plans a sweep need not wait for

    return Agilent4294A(link)


DRIVER = InstrumentDriver("HP, Agilent or Keysight 4294A", IDN, lambda _: CAPABILITIES, _opened, assumed=True)
