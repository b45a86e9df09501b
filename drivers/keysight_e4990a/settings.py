"""The settings of an E4990A that a sweep needs: how each is written, read back, and compared.

Sources for the commands: [1] rjollos/e4990a (Python), [2] the E4990A class of magdynlab, [3] that of a probe station's
program (Keysight_E4990A, PySide), [4] a pymeasure driver that quotes the instrument's help. Each line names those that
send it. Not confirmed by any of them: SOURce:CURRent (not used), the delay that SENSe:SWEep:DELay sets (not used), and
the six digits in the header of a block, which are in the E5061B's manual.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from ..base.analyzer import InstrumentError
from ..visa import replies
from ..visa.connection import Connection

Value = float | bool | str

BLOCK_DIGITS = 6

TRACES = (
    *("Z", "Y", "R", "X", "G", "B", "LS", "LP", "CS", "CP", "RS", "RP", "Q", "D", "TZ", "TY"),
    *("VAC", "IAC", "VDC", "IDC", "IMP", "ADM"),
)
"""Quantities of a trace [4]."""


@dataclass(frozen=True)
class Setting:
    """A setting: its command, its common name, and its allowed words (none: a number)."""

    header: str
    words: str
    allowed: tuple[str, ...] = ()
    flag: bool = False

    def read(self, text: str, what: str) -> Value:
        """Return the value of `text`. Raises InstrumentError."""
        if self.flag:
            return replies.flag(text, what)
        return replies.word(text, what, self.allowed) if self.allowed else replies.number(text, what)

    def agrees(self, asked: Value, got: Value) -> bool:
        """Tell whether `got` equals the requested value to the instrument's resolution."""
        if self.flag or self.allowed:
            return asked == got
        return math.isclose(float(asked), float(got), rel_tol=1e-6, abs_tol=1e-3)


# In the order of restoring: a setting that another depends on comes first.
SETTINGS: Mapping[str, Setting] = {
    "continuous": Setting(":INIT1:CONT", "continuous initiation", flag=True),  # [1] [2] [3] [4]
    "source": Setting(":TRIG:SOUR", "trigger source", ("INT", "EXT", "MAN", "BUS")),  # [1] [2] [3] [4]
    "start": Setting(":SENS1:FREQ:STAR", "start"),  # [1] [2] [3] [4]
    "stop": Setting(":SENS1:FREQ:STOP", "stop"),  # [1] [2] [3] [4]
    "points": Setting(":SENS1:SWE:POIN", "number of points"),  # [1] [2] [3] [4]
    "type": Setting(":SENS1:SWE:TYPE", "sweep type", ("LIN", "LOG", "SEGM", "BIAS", "LBI")),  # [1] [3]
    "direction": Setting(":SENS1:SWE:DIR", "sweep direction", ("UP", "DOWN")),  # [3] [4]
    "speed": Setting(":SENS1:APER", "measurement speed"),  # [3] [4]; [1] has :SENS1:APER:TIME
    "point_average": Setting(":SENS1:AVER:COUN", "point averaging factor"),  # [1] [3]
    "point_averaging": Setting(":SENS1:AVER:STAT", "point averaging", flag=True),  # [1] [2] [3]
    "sweep_average": Setting(":CALC1:AVER:COUN", "sweep averaging factor"),  # [1] [3]
    "sweep_averaging": Setting(":CALC1:AVER:STAT", "sweep averaging", flag=True),  # [3]; [1] has :CALC1:AVER
    "trigger_averages": Setting(":TRIG:SEQ:AVER", "averaging trigger", flag=True),  # [1]
    "mode": Setting(":SOUR1:MODE", "oscillator mode", ("VOLT", "CURR")),  # [1] [2] [4]
    "level": Setting(":SOUR1:VOLT", "oscillator level"),  # [1] [2] [3] [4]
    "bias_mode": Setting(":SOUR1:BIAS:MODE", "bias mode", ("VOLT", "CURR")),  # [1] [2] [4]
    "bias": Setting(":SOUR1:BIAS:VOLT", "bias"),  # [1] [2] [3] [4]
    "trace_1": Setting(
        ":CALC1:PAR1:DEF",
        "parameter of trace 1",
        TRACES,
    ),  # [1] [3] [4]
}
"""Every setting that the driver changes; all of them are restored."""

BIAS_ON = Setting(":SOUR:BIAS:STAT", "bias output", flag=True)  # [1] [3] [4]

STILL_BIASED = "{}: the DC bias is still ON after :SOUR:BIAS:STAT OFF; switch it off at the front panel"

CORRECTIONS: Mapping[str, Setting] = {
    "open": Setting(":SENS1:CORR2:OPEN", "open compensation", flag=True),  # [1]
    "short": Setting(":SENS1:CORR2:SHOR", "short compensation", flag=True),  # [1]
    "load": Setting(":SENS1:CORR2:LOAD", "load compensation", flag=True),  # from a driver that only reads it
}
"""Settings of the bench: recorded with every sweep, never changed by one."""


def text_of(value: Value) -> str:
    """Return `value` in the instrument's notation."""
    if isinstance(value, bool):
        return "ON" if value else "OFF"
    return value if isinstance(value, str) else f"{value:.12g}"


def query(link: Connection, setting: Setting) -> Value:
    """Return the present value of a setting. Raises InstrumentError."""
    return setting.read(link.ask(f"{setting.header}?"), f"{link.name}: {setting.words} ({setting.header}?)")


def put(link: Connection, setting: Setting, value: Value) -> Value:
    """Set a setting and return what is read back. Raises InstrumentError where it was not taken."""
    message = f"{setting.header} {text_of(value)};{setting.header}?"
    got = setting.read(link.ask(message), f"{link.name}: {setting.words} ({setting.header}?)")
    if not setting.agrees(value, got):
        raise InstrumentError(
            f"{link.name}: {setting.words} ({setting.header}) was set to {text_of(value)} but reads back "
            f"{text_of(got)}; the instrument did not take it"
        )
    return got


def bias_off(link: Connection) -> None:
    """Switch the bias off and verify it. Raises InstrumentError."""
    header = BIAS_ON.header
    if BIAS_ON.read(link.ask(f"{header} OFF;{header}?"), f"{link.name}: {BIAS_ON.words} ({header}?)"):
        raise InstrumentError(STILL_BIASED.format(link.name))


def snapshot(link: Connection, names: Iterable[str] = SETTINGS) -> dict[str, Value]:
    """Return the present values of settings, by their names here. Raises InstrumentError."""
    return {name: query(link, SETTINGS[name]) for name in names}


def check_errors(link: Connection, doing: str) -> None:
    """Raise InstrumentError if the error queue is not empty; it is empty afterwards."""
    found: list[str] = []
    for _ in range(101):  # the queue of this family has 100 entries
        answer = link.ask(":SYST:ERR?")
        number, _, text = answer.partition(",")
        if replies.integer(number, f"{link.name}: :SYST:ERR?") == 0:
            break
        found.append(f"error {number} ({text.strip(chr(34))})")
    if found:
        raise InstrumentError(f"{link.name}: {doing}, the instrument reports {'; '.join(found)}")
