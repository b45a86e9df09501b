"""The settings of a 4294A: how each is written, read back, and compared.

The instrument silently takes the nearest possible value (Programming Manual, out-of-range rule), and scripts have
measured for years with settings that never took effect. So every setting is sent with its own query in one message
(`POIN 801;POIN?`), and the reply must equal the requested value to half the setting's resolution: the instrument
answers with fifteen digits (`+1.00000000000000E+007`, p.175).
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
"""Digits in the header of a binary block: `#6000048` (Programming Manual p.80)."""


@dataclass(frozen=True)
class NumberSetting:
    """A numeric setting: its common name, its unit, and how exactly it must read back."""

    words: str
    unit: str = ""
    relative: float = 1e-11
    absolute: float = 0.0

    def read(self, text: str, what: str) -> float:
        """Return the value of `text`. Raises InstrumentError."""
        return replies.number(text, what)

    def agrees(self, asked: Value, got: Value) -> bool:
        """Tell whether `got` equals the requested value to the digits of the reply (deviating by a tenth at most)."""
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
    """A setting that takes one of several words."""

    words: str
    allowed: tuple[str, ...]
    unit: str = ""

    def read(self, text: str, what: str) -> str:
        """Return the word in `text`. Raises InstrumentError."""
        return replies.word(text, what, self.allowed)

    def agrees(self, asked: Value, got: Value) -> bool:
        """Tell whether `got` is what was asked."""
        return asked == got


Kind = NumberSetting | FlagSetting | ChoiceSetting

# In the order of restoring: a setting that another depends on comes first.
SETTINGS: dict[str, Kind] = {
    "SWPP": ChoiceSetting("sweep parameter", ("FREQ", "OLEV", "DCB")),
    # Both determine the unit of START and STOP in a sweep of level or bias.
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
"""Settings of the bench: recorded with every sweep, never changed by one."""

_KINDS = SETTINGS | CONDITIONS


def text_of(value: Value) -> str:
    """Return `value` in the instrument's notation: a decimal point whatever the locale, 1 mHz resolved at 110 MHz."""
    if isinstance(value, bool):
        return "ON" if value else "OFF"
    return value if isinstance(value, str) else f"{value:.12g}"


def query(link: Connection, mnemonic: str) -> Value:
    """Return the present value of the setting or condition `mnemonic`. Raises InstrumentError."""
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
    """Raise InstrumentError where a sweep of another range would discard the instrument's correction.

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
