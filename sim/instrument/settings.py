"""The instrument's settings: a table of mnemonics with range, default and format of the answer (reference 2.1-2.5).

Numbers out of range are clamped silently, as in the instrument; unknown tokens are refused.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from ..language.messages import CommandError, unquote

Value: TypeAlias = float | int | bool | str

_NUMBER = re.compile(rb"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z]*)\s*\Z")
_SCALE: Mapping[str, Mapping[str, float]] = {
    "HZ": {"": 1.0, "HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6},  # MHZ is megahertz here, not millihertz
    "V": {"": 1.0, "V": 1.0},
    "A": {"": 1.0, "A": 1.0},
    "S": {"": 1.0, "S": 1.0},
    "": {"": 1.0},
}


def number(argument: bytes, unit: str = "") -> float:
    """Return a numeric parameter in SI. Raises CommandError where it is no number or has another unit's suffix."""
    match = _NUMBER.match(argument)
    if match is None:
        raise CommandError(-104, "DATA TYPE ERROR")
    scale = _SCALE[unit].get(match[2].decode("ascii").upper())
    if scale is None:
        raise CommandError(-131, "INVALID SUFFIX")
    value = float(match[1]) * scale
    if not math.isfinite(value):
        raise CommandError(-123, "EXPONENT TOO LARGE")
    return value


@dataclass(frozen=True)
class Number:
    """A real setting, clamped to `low ... high`."""

    low: float
    high: float
    default: float
    unit: str = ""
    step: float = 0.0
    """Resolution in SI; 0 where none is documented."""

    def parse(self, argument: bytes) -> float:
        """Return the value that is set. Raises CommandError."""
        return self.rounded(min(max(number(argument, self.unit), self.low), self.high))

    def rounded(self, value: float) -> float:
        """Return the value on the grid of the resolution."""
        return round(value * round(1 / self.step)) / round(1 / self.step) if self.step else value

    def answer(self, value: Value) -> str:
        """Return the reply to the query: twelve digits for frequencies, seven for the rest."""
        return f"{value:+.11E}" if self.unit == "HZ" else f"{value:+.6E}"


@dataclass(frozen=True)
class Integer:
    """A whole number, clamped."""

    low: int
    high: int
    default: int

    def parse(self, argument: bytes) -> int:
        """Return the value that is set. Raises CommandError."""
        return round(min(max(number(argument), self.low), self.high))

    def answer(self, value: Value) -> str:
        """Return the reply: a bare integer."""
        return f"{value:d}" if isinstance(value, int) else str(value)


@dataclass(frozen=True)
class Choice:
    """One of a list of tokens."""

    tokens: tuple[str, ...]
    default: str

    def parse(self, argument: bytes) -> str:
        """Return the token. Raises CommandError for one that is not of the list."""
        token = argument.decode("latin-1").upper()
        if token not in self.tokens:
            raise CommandError(-224, "ILLEGAL PARAMETER VALUE")
        return token

    def answer(self, value: Value) -> str:
        """Return the token."""
        return str(value)


@dataclass(frozen=True)
class Switch:
    """ON or OFF; the query answers 1 or 0."""

    default: bool

    def parse(self, argument: bytes) -> bool:
        """Return whether it is on. Raises CommandError."""
        token = argument.upper()
        if token not in (b"ON", b"OFF", b"1", b"0"):
            raise CommandError(-224, "ILLEGAL PARAMETER VALUE")
        return token in (b"ON", b"1")

    def answer(self, value: Value) -> str:
        """Return `1` or `0`."""
        return "1" if value else "0"


@dataclass(frozen=True)
class Text:
    """A string in quotes."""

    default: str
    limit: int = 53

    def parse(self, argument: bytes) -> str:
        """Return the text, cut to what the screen holds. Raises CommandError where the quotes are missing."""
        return unquote(argument)[: self.limit]

    def answer(self, value: Value) -> str:
        """Return the text in quotes."""
        return f'"{value}"'


Setting: TypeAlias = Number | Integer | Choice | Switch | Text

MEASUREMENTS = (
    *("IMPH", "IRIM", "LSR", "LSQ", "CSR", "CSQ", "CSD", "AMPH", "ARIM", "LPG", "LPQ", "CPG", "CPQ", "CPD"),
    *("COMP", "IMLS", "IMCS", "IMLP", "IMCP", "IMRS", "IMQ", "IMD", "LPR", "CPR"),
)
"""The 24 measurement parameters of `MEAS`."""

TABLE: Mapping[str, Setting] = {
    # what is measured and swept
    "MEAS": Choice(MEASUREMENTS, "IMPH"),
    "SWPP": Choice(("FREQ", "OLEV", "DCB"), "FREQ"),
    "SWPT": Choice(("LIN", "LOG", "LIST"), "LIN"),
    "SWED": Choice(("UP", "DOWN"), "UP"),
    "POIN": Integer(2, 801, 201),
    "CWFREQ": Number(40.0, 110e6, 1e3, "HZ", 1e-3),
    "SDELT": Number(0.0, 30.0, 0.0, "S", 1e-3),
    "PDELT": Number(0.0, 30.0, 0.0, "S", 1e-3),
    # signal, bias, bandwidth, averaging
    "POWMOD": Choice(("VOLT", "CURR"), "VOLT"),
    "DCO": Switch(False),
    "DCMOD": Choice(("VOLT", "CURR", "CVOLT", "CCURR"), "VOLT"),
    "DCRNG": Choice(("M1", "M10", "M100"), "M1"),
    "DCV": Number(-40.0, 40.0, 0.0, "V", 1e-3),
    "DCI": Number(-0.1, 0.1, 0.0, "A", 20e-6),
    "BWFACT": Integer(1, 5, 1),
    "PAVER": Switch(False),
    "PAVERFACT": Integer(1, 256, 4),
    "AVER": Switch(False),
    "AVERFACT": Integer(1, 256, 16),
    "TRGS": Choice(("INT", "EXT", "BUS", "MAN"), "INT"),
    # adapter, calibration, compensation
    "E4TP": Choice(("OFF", "M1", "M2", "APC7", "PROBE"), "OFF"),
    "CALP": Choice(("FIXED", "USER"), "FIXED"),
    "DCOMOPENG": Number(-1e6, 1e6, 0.0),
    "DCOMOPENC": Number(-1e6, 1e6, 0.0),
    "DCOMSHORR": Number(-1e6, 1e6, 0.0),
    "DCOMSHORL": Number(-1e6, 1e6, 0.0),
    "DCOMLOADR": Number(-1e6, 1e6, 50.0),
    "DCOMLOADL": Number(-1e6, 1e6, 0.0),
    # equivalent circuit: the fourth letter of the answer names it
    "EQUC": Choice(("CIRA", "CIRB", "CIRC", "CIRD", "CIRE"), "CIRE"),
    # display and files
    "TRAC": Choice(("A", "B"), "A"),
    "TITL": Text(""),
    "FMT": Choice(("LINY", "LOGY"), "LINY"),
    "TOPV": Number(-1e12, 1e12, 1e3),
    "BOTV": Number(-1e12, 1e12, 0.0),
    "SPLD": Switch(False),
    "HIDI": Switch(False),
    "MEASTAT": Switch(False),
    "BEEPWARN": Switch(True),
    "BEEPDONE": Switch(True),
    "STOD": Choice(("MEMO", "FLASH", "DISK"), "MEMO"),
    "PRIC": Choice(("VARI", "FIXE"), "VARI"),
}
"""Settings whose range does not depend on the state; `state` has the others."""

PER_TRACE = frozenset({"TITL", "FMT", "TOPV", "BOTV"})
"""Settings that each trace has of its own; commands set those of the active trace."""

RESTARTS_SWEEP = frozenset(
    {"SWPP", "SWPT", "SWED", "POIN", "CWFREQ", "SDELT", "PDELT", "POWMOD", "DCMOD", "DCV", "DCI", "BWFACT", "PAVER"}
    | {"PAVERFACT", "AVER", "AVERFACT", "TRGS", "E4TP", "STAR", "STOP", "CENT", "SPAN", "POWE"}
)
"""A running sweep begins anew when one of these is changed."""
