"""Identifies an E4990A by its *IDN? reply; the package's entry point refers to this module."""

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
    from .instrument import (
        KeysightE4990A,
    )  # imported late: it loads pyvisa, which is slow and not needed to plan a sweep

    return KeysightE4990A(link)


DRIVER = InstrumentDriver("Keysight E4990A", IDN, lambda _: CAPABILITIES, _opened)
