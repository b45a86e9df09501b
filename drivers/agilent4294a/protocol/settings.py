"""The settings of a 4294A: how each is written, read back, and compared.

The instrument takes the nearest possible value without a word (Programming Manual, out-of-range rule), and scripts
have measured for years with settings that were never taken. So every setting is sent with its own query in one
message (`POIN 801;POIN?`), and what comes back must be what was asked, to half the setting's resolution: the
instrument answers with fifteen digits (`+1.00000000000000E+007`, p.175).
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection
from ..capabilities import CAPABILITIES

Value = float | bool | str

LENGTH_DIGITS = 6
"""In the head of a binary block: `#6000048` (Programming Manual p.80)."""


@dataclass(frozen=True)
class NumberSetting:
    """A setting that is a number: what people call it, its unit, and how exactly it must come back."""

    words: str
    unit: str = ""
    relative: float = 1e-11
    absolute: float = 0.0

    def read(self, text: str, what: str) -> float:
        """Return the value that `text` says. Raises InstrumentError."""
        return replies.number(text, what)

    def agrees(self, asked: Value, got: Value) -> bool:
        """Tell whether `got` is what was asked, to the digits an answer may have (never further off than a tenth)."""
        absolute = min(self.absolute, abs(float(asked)) / 10)
        return math.isclose(float(asked), float(got), rel_tol=self.relative, abs_tol=absolute)


@dataclass(frozen=True)
class FlagSetting:
    """A setting that is on or off."""

    words: str
    unit: str = ""

    def read(self, text: str, what: str) -> bool:
        """Return whether `text` says on. Raises InstrumentError."""
        return replies.flag(text, what)

    def agrees(self, asked: Value, got: Value) -> bool:
        """Tell whether `got` is what was asked."""
        return asked == got


@dataclass(frozen=True)
class ChoiceSetting:
    """A setting that is one of some words."""

    words: str
    allowed: tuple[str, ...]
    unit: str = ""

    def read(self, text: str, what: str) -> str:
        """Return the word that `text` is. Raises InstrumentError."""
        return replies.word(text, what, self.allowed)

    def agrees(self, asked: Value, got: Value) -> bool:
        """Tell whether `got` is what was asked."""
        return asked == got


Kind = NumberSetting | FlagSetting | ChoiceSetting

# The order is that of restoring: what a later value depends on stands before it.
SETTINGS: dict[str, Kind] = {
    "SWPP": ChoiceSetting("sweep parameter", ("FREQ", "OLEV", "DCB")),
    # Both say in which unit a sweep of level or bias starts and stops.
    "POWMOD": ChoiceSetting("oscillator mode", ("VOLT", "CURR")),
    "DCMOD": ChoiceSetting("bias mode", ("VOLT", "CURR", "CVOLT", "CCURR")),
    "SWPT": ChoiceSetting("sweep type", ("LIN", "LOG", "LIST")),
    "STAR": NumberSetting("start", "Hz", absolute=6e-4),
    "STOP": NumberSetting("stop", "Hz", absolute=6e-4),
    "POIN": NumberSetting("number of points", relative=0),
    "SWED": ChoiceSetting("sweep direction", ("UP", "DOWN")),
    "SDELT": NumberSetting("sweep delay", "s", absolute=6e-4),
    "PDELT": NumberSetting("point delay", "s", absolute=6e-4),
    "BWFACT": NumberSetting("bandwidth", relative=0),
    "PAVER": FlagSetting("point averaging"),
    "PAVERFACT": NumberSetting("point averaging factor", relative=0),
    "AVER": FlagSetting("sweep averaging"),
    "AVERFACT": NumberSetting("sweep averaging factor", relative=0),
    # The level is set in steps of 1 mV (Programming Manual p.403); the recording keeps what was read back.
    "POWE": NumberSetting("oscillator level", absolute=6e-4),
    "DCRNG": ChoiceSetting("bias range", ("M1", "M10", "M100")),
    "DCV": NumberSetting("bias", "V", absolute=6e-4),
    "DCO": FlagSetting("bias output"),
    "TRGS": ChoiceSetting("trigger source", ("INT", "EXT", "BUS", "MAN")),
}
"""Every setting the driver sets, by mnemonic."""

CONDITIONS: dict[str, Kind] = {
    "CALP": ChoiceSetting("points of compensation", ("FIXED", "USER")),
    "E4TP": ChoiceSetting("adapter", tuple(CAPABILITIES.adapters)),
    "CALST": FlagSetting("user calibration"),
    "COMSTA": FlagSetting("open compensation"),
    "COMSTB": FlagSetting("short compensation"),
    "COMSTC": FlagSetting("load compensation"),
}
"""What belongs to the bench: recorded with every sweep, never changed by one."""

_KINDS = SETTINGS | CONDITIONS


def text_of(value: Value) -> str:
    """Return `value` as the instrument wants it: a decimal point whatever the locale, 1 mHz kept at 110 MHz."""
    if isinstance(value, bool):
        return "ON" if value else "OFF"
    return value if isinstance(value, str) else f"{value:.12g}"


def query(link: Connection, mnemonic: str) -> Value:
    """Return the setting or condition `mnemonic` as the instrument has it. Raises InstrumentError."""
    kind = _KINDS[mnemonic]
    return kind.read(link.ask(f"{mnemonic}?"), f"{link.name}: {kind.words} ({mnemonic}?)")


def put(link: Connection, mnemonic: str, value: Value) -> Value:
    """Set `mnemonic` to `value` and return what is read back. Raises InstrumentError where it was not taken."""
    kind = _KINDS[mnemonic]
    got = kind.read(link.ask(f"{mnemonic} {text_of(value)};{mnemonic}?"), f"{link.name}: {kind.words} ({mnemonic}?)")
    if not kind.agrees(value, got):
        unit = f" {kind.unit}" if kind.unit else ""
        raise InstrumentError(
            f"{link.name}: {kind.words} ({mnemonic}) was set to {text_of(value)}{unit} but reads back "
            f"{text_of(got)}{unit}; the instrument did not take it"
        )
    return got


def check_corrections(link: Connection) -> None:
    """Raise InstrumentError where a sweep of another range would cost the instrument its correction.

    Standards measured at the points of one sweep (`CALP USER`) are dropped, with error 13, as soon as its range, points
    or type is changed (Programming Manual p.275).
    """
    if query(link, "CALP") != "USER":
        return
    measured = [CONDITIONS[name].words for name in CONDITIONS if name not in ("CALP", "E4TP") and query(link, name)]
    if measured:
        raise InstrumentError(
            f"{link.name}: {' and '.join(measured)} holds for the points of the sweep that is set (CALP USER) and "
            "would be lost; measure it at the fixed points with pzctl compensate, or give it up with CALP FIXED"
        )


def snapshot(link: Connection, mnemonics: Iterable[str]) -> dict[str, Value]:
    """Return the present value of each of `mnemonics`. Raises InstrumentError."""
    return {mnemonic: query(link, mnemonic) for mnemonic in mnemonics}


def compare(link: Connection, wanted: Mapping[str, Value], got: Mapping[str, Value], what: str) -> None:
    """Raise InstrumentError, saying `what` happened to the setting, where one `got` is not as `wanted`."""
    for mnemonic, value in wanted.items():
        kind = _KINDS[mnemonic]
        if not kind.agrees(value, got[mnemonic]):
            found = f"{kind.words} ({mnemonic}) was {text_of(value)}, is {text_of(got[mnemonic])}"
            raise InstrumentError(f"{link.name}: {found}: {what}")
