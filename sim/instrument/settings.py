"""The instrument's settings: range, default and reply format of each, from the table of the command reference.

Numbers out of range are clamped silently, as in the instrument; unknown tokens are refused.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TypeAlias

from ..language.command_table import ROWS, Row
from ..language.formats import printed
from ..language.messages import CommandError, unquote

Value: TypeAlias = float | int | bool | str

_NUMBER = re.compile(rb"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*([A-Za-z]*)\s*\Z")
_TWO_WORDS = re.compile(rb"\s*[+-]?[\d.]+(?:[eE][+-]?\d+)?\s*[A-Za-z]*\s+[A-Za-z]")
"""A number followed by the next mnemonic without the `;` between them."""

_FREQUENCY = {"HZ": 1.0, "KHZ": 1e3, "MHZ": 1e6}  # MHZ is megahertz here, not millihertz
_OF_TRACES: Mapping[str, float] = {"OHM": 1.0, "DEG": 1.0, "RAD": 1.0, "SIE": 1.0, "H": 1.0, "F": 1.0, "PCT": 1.0}
_SCALE: Mapping[str, Mapping[str, float]] = {
    "HZ": _FREQUENCY,
    **{unit: {unit: 1.0} for unit in ("V", "A", "S", "M", "PCT")},
    **dict.fromkeys(("OHM", "SIE", "H", "F"), _OF_TRACES),
    "ANY": {**_FREQUENCY, **_OF_TRACES, "V": 1.0, "A": 1.0},
    "": {},
}
"""Suffixes by the unit of a setting, with their factors; a suffix is optional. `ANY`: the unit of a trace."""


def number(argument: bytes, unit: str = "") -> float:
    """Return a numeric parameter in SI. Raises CommandError where it is no number or has another unit's suffix."""
    match = _NUMBER.match(argument)
    if match is None:
        raise CommandError(-103 if _TWO_WORDS.match(argument) else -104)
    suffix = match[2].decode("ascii").upper()
    scale = _SCALE[unit].get(suffix) if suffix else 1.0
    if scale is None:
        raise CommandError(-131)
    value = float(match[1]) * scale
    if not math.isfinite(value):
        raise CommandError(-123)
    return value


def whole(argument: bytes, low: int, high: int) -> int:
    """Return a whole number, clamped to `low ... high`. Raises CommandError."""
    return round(min(max(number(argument), low), high))


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
        """Return the reply to the query."""
        return printed(float(value))


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
        word = argument.decode("latin-1").upper()
        if word == "FIXED" and "FIX" in self.tokens:  # the only token for which the manual gives a long form
            word = "FIX"
        if word not in self.tokens:
            raise CommandError(-141)
        return word

    def answer(self, value: Value) -> str:
        """Return the token."""
        return str(value)


@dataclass(frozen=True)
class Switch:
    """ON or OFF; the query answers 1 or 0."""

    default: bool

    def parse(self, argument: bytes) -> bool:
        """Return whether it is on. Raises CommandError."""
        token = argument.strip().upper()
        if token not in (b"ON", b"OFF", b"1", b"0"):
            raise CommandError(-141)
        return token in (b"ON", b"1")

    def answer(self, value: Value) -> str:
        """Return `1` or `0`."""
        return "1" if value else "0"


@dataclass(frozen=True)
class Text:
    """A string in quotes."""

    default: str
    limit: int

    def parse(self, argument: bytes) -> str:
        """Return the text, truncated to the width of the screen. Raises CommandError where the quotes are missing."""
        return unquote(argument)[: self.limit]

    def answer(self, value: Value) -> str:
        """Return the text in quotes."""
        return f'"{value}"'


@dataclass(frozen=True)
class Integers:
    """Several whole numbers, each clamped, as in an IP address."""

    count: int
    low: int
    high: int
    default: str

    def parse(self, argument: bytes) -> str:
        """Return the numbers with commas between them. Raises CommandError."""
        parts = argument.split(b",")
        if len(parts) != self.count:
            raise CommandError(-109 if len(parts) < self.count else -108)
        return ",".join(str(whole(part, self.low, self.high)) for part in parts)

    def answer(self, value: Value) -> str:
        """Return the numbers."""
        return str(value)


Setting: TypeAlias = Number | Integer | Integers | Choice | Switch | Text


def _setting(row: Row) -> Setting:
    words = row.rest.split()
    match row.kind:
        case "switch":
            return Switch(row.initial == "ON")
        case "token":
            return Choice(tuple(row.rest.split("|")), row.initial)
        case "int":
            return Integer(int(words[0]), int(words[1]), int(row.initial or words[0]))
        case "ints":
            return Integers(int(words[0]), int(words[1]), int(words[2]), row.initial)
        case "text":
            return Text(row.initial, int(words[0]))
        case _:
            low, high, unit, step = words
            return Number(float(low), float(high), float(row.initial), unit.strip("-"), float(step))


TABLE: Mapping[str, Setting] = {
    row.mnemonic: _setting(row)
    for row in ROWS.values()
    if row.kind in ("switch", "token", "int", "ints", "text", "real")
}
"""Settings whose range does not depend on the state; the others are in `state`."""

MEASUREMENTS = ROWS["MEAS"].rest.split("|")
"""The 24 measurement parameters of `MEAS`."""

PER_TRACE = frozenset(name for name in TABLE if ROWS[name].scope == "trace")
"""Settings that each trace has separately; commands set those of the active trace."""

PER_ITEM = frozenset(name for name in TABLE if ROWS[name].scope == "item")
"""Settings of a colour; commands set those of the item selected by COLO."""

SCREEN_ITEMS = ROWS["COLO"].rest.split("|")

KEPT = frozenset(name for name in TABLE if ROWS[name].scope == "kept")
"""Settings that a preset does not change."""

RESTARTS_SWEEP = frozenset(
    {"SWPP", "SWPT", "SWED", "POIN", "CWFREQ", "SDELT", "PDELT", "POWMOD", "DCMOD", "DCV", "DCI", "BWFACT", "PAVER"}
    | {"PAVERFACT", "AVER", "AVERFACT", "TRGS", "TRGEVE", "MANS", "E4TP", "STAR", "STOP", "CENT", "SPAN", "POWE"}
)
"""A running sweep restarts when one of these settings changes."""
