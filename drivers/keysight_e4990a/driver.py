"""How an E4990A is found: by its identification, through the entry point of this package."""

import re
from typing import TYPE_CHECKING

from ..base.driver import InstrumentDriver
from .capabilities import CAPABILITIES

if TYPE_CHECKING:
    from ..visa.connection import Connection
    from .instrument import KeysightE4990A

# `Agilent Technologies,E4990A,MY54100800,A.02.12`; later ones say Keysight.
IDN = re.compile(r"(AGILENT|KEYSIGHT) TECHNOLOGIES, ?E4990A, ?([^,]*), ?([^,]*)", re.IGNORECASE)


def _opened(link: "Connection") -> "KeysightE4990A":
    from .instrument import KeysightE4990A  # with pyvisa, which who only plans a sweep need not wait for

    return KeysightE4990A(link)


DRIVER = InstrumentDriver("Keysight E4990A", IDN, lambda _: CAPABILITIES, _opened)
