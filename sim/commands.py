"""The command table: every mnemonic that is not a plain setting, with how many parameters it takes and what it does."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from ..models.arrays import Complexes, Impedances
from .correction import FIXED_POINTS, STANDARDS, Correction
from .filecommands import FILE_COMMANDS, FILE_QUERIES
from .formats import decode, encode, pairs, seven_digits
from .instrument import Instrument, Memory
from .messages import CommandError, Unit
from .settings import number
from .status import OPC
from .sweeping import FOREVER
from .traces import trace

Act: TypeAlias = Callable[[Instrument, Unit], None]
Ask: TypeAlias = Callable[[Instrument, Unit], bytes | str]

OVERLOAD = CommandError(137, "DC BIAS OVERLOAD")
RANGE_AMPERE = {"M1": 1e-3, "M10": 10e-3, "M100": 100e-3}
BIAS_OHM = 2e3
"""Resistance that the bias charges the device through: what a bias voltage asks of the range [our assumption]."""


@dataclass(frozen=True)
class Entry:
    """One command or query of the table."""

    run: Callable[[Instrument, Unit], bytes | str | None]
    least: int = 0
    most: int = 0


def run(instrument: Instrument, unit: Unit, message_available: bool) -> bytes | None:
    """Carry out one unit; return its answer, None for a command. Raises CommandError."""
    if unit.header == "*STB?":
        return str(instrument.status.byte(message_available)).encode("ascii")
    entry = _entry(instrument, unit)
    if entry is None:
        raise CommandError(-113, "UNDEFINED HEADER")
    if len(unit.arguments) < entry.least:
        raise CommandError(-109, "MISSING PARAMETER")
    if len(unit.arguments) > entry.most:
        raise CommandError(-108, "PARAMETER NOT ALLOWED")
    answer = entry.run(instrument, unit)
    return answer.encode("latin-1") if isinstance(answer, str) else answer


def _entry(instrument: Instrument, unit: Unit) -> Entry | None:
    if instrument.state.knows(unit.mnemonic) and unit.header not in COMMANDS:
        return _READ_SETTING if unit.query else _WRITE_SETTING
    return QUERIES.get(unit.mnemonic) if unit.query else COMMANDS.get(unit.mnemonic)


_READ_SETTING = Entry(lambda i, u: i.state.query(u.mnemonic))
_WRITE_SETTING = Entry(lambda i, u: i.set(u.mnemonic, u.arguments[0]), 1, 1)


# commands ------------------------------------------------------------------------------------------------------


def _whole(argument: bytes, low: int, high: int) -> int:
    return round(min(max(number(argument), low), high))


def _groups(instrument: Instrument, unit: Unit) -> None:
    instrument.sweeper.start(_whole(unit.arguments[0], 1, 999))


def _trigger(instrument: Instrument, _: Unit) -> None:
    if instrument.state["TRGS"] != "BUS" or not instrument.sweeper.trigger():
        raise CommandError(-211, "TRIGGER IGNORED")


def _operation_complete(instrument: Instrument, _: Unit) -> None:
    if instrument.sweeper.seconds_left() > 0:
        instrument.opc_wanted = True
    else:
        instrument.status.raise_standard(OPC)


def _clear(instrument: Instrument, _: Unit) -> None:
    instrument.status.clear()
    instrument.opc_wanted = False


def _bias(instrument: Instrument, unit: Unit) -> None:
    """DCO ON is refused with 137 where the bias asks more current than the range gives."""
    state = instrument.state
    if unit.arguments[0].upper() in (b"ON", b"1"):
        voltage = str(state["DCMOD"]).endswith("VOLT")
        ampere = abs(state.real("DCV")) / BIAS_OHM if voltage else abs(state.real("DCI"))
        if instrument.bias_overload or ampere > RANGE_AMPERE[str(state["DCRNG"])]:
            raise OVERLOAD
    instrument.set("DCO", unit.arguments[0])


def _restart_average(instrument: Instrument, _: Unit) -> None:
    instrument.sweeper.restart()


def _data_to_memory(instrument: Instrument, _: Unit) -> None:
    instrument.memory = Memory(instrument.sweeper.axis, instrument.sweeper.data)


def _measure_standard(bank: Callable[[Instrument], Correction], standard: str) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        axis = instrument.state.axis()
        if instrument.state["CALP"] == "FIXED" or np.any(np.diff(axis.frequency) <= 0):
            same = np.ones(FIXED_POINTS.size)
            axis = replace(
                axis, values=FIXED_POINTS, frequency=FIXED_POINTS, level=same * axis.level[0],
                bias=same * axis.bias[0], bandwidth=same * axis.bandwidth[0],
                point_average=same * axis.point_average[0],
            )  # fmt: skip
        through_calibration = bank(instrument) is instrument.compensation

        def done(z: Impedances) -> None:
            seen = instrument.calibration.apply(axis.frequency, z, instrument.state) if through_calibration else z
            bank(instrument).store(standard, axis.frequency, seen)

        instrument.sweeper.start(1, lambda _axis, z: done(z), axis)

    return act


def _switch(bank: Callable[[Instrument], Correction], standards: str) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        on = unit.arguments[0].upper()
        if on not in (b"ON", b"OFF", b"1", b"0"):
            raise CommandError(-224, "ILLEGAL PARAMETER VALUE")
        for standard in standards:
            bank(instrument).switch(standard, on in (b"ON", b"1"))

    return act


def _calibration(instrument: Instrument) -> Correction:
    return instrument.calibration


def _compensation(instrument: Instrument) -> Correction:
    return instrument.compensation


def _put_correction(bank: Callable[[Instrument], Correction], standard: str) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        fixed = instrument.state["CALP"] == "FIXED"
        frequency = FIXED_POINTS if fixed else instrument.state.axis().frequency
        values = _complex(decode(unit.arguments, instrument.state.form, 2 * frequency.size))
        bank(instrument).store(standard, frequency, 1 / values if standard == "A" else values)

    return act


def _put_data(instrument: Instrument, unit: Unit) -> None:
    axis = instrument.state.axis()
    values = _complex(decode(unit.arguments, instrument.state.form, 2 * axis.values.size))
    instrument.sweeper.axis, instrument.sweeper.data = axis, values


def _form(form: int) -> Entry:
    return Entry(lambda i, _: setattr(i.state, "form", form))


def _edit_list(instrument: Instrument, _: Unit) -> None:
    instrument.state.editing = True


def _end_edit(instrument: Instrument, _: Unit) -> None:
    instrument.state.editing, instrument.state.draft = False, None
    if instrument.state["SWPT"] == "LIST":
        instrument.sweeper.forget()
        instrument.sweeper.restart()


def _clear_list(instrument: Instrument, _: Unit) -> None:
    if not instrument.state.editing:
        raise CommandError(-221, "SETTINGS CONFLICT; EDITLIST FIRST")
    if instrument.state["SWPT"] == "LIST":
        raise CommandError(-221, "SETTINGS CONFLICT; LIST SWEEP IS ON")
    instrument.state.table.clear()


def _enable(name: str, limit: int) -> Entry:
    return Entry(lambda i, u: setattr(i.status, name, _whole(u.arguments[0], 0, limit)), 1, 1)


COMMANDS: Mapping[str, Entry] = {
    "*RST": Entry(lambda i, _: i.reset(continuous=False)),
    "PRES": Entry(lambda i, _: i.reset(continuous=True)),
    "*CLS": Entry(_clear),
    "CLES": Entry(_clear),
    "*OPC": Entry(_operation_complete),
    "*WAI": Entry(lambda i, _: None),  # the wait itself is in Instrument.perform
    "*TRG": Entry(_trigger),
    "*ESE": _enable("standard_enable", 255),
    "*SRE": _enable("request_enable", 255),
    "ESNB": _enable("instrument_enable", 65535),
    "HOLD": Entry(lambda i, _: i.sweeper.hold()),
    "CONT": Entry(lambda i, _: i.sweeper.start(FOREVER)),
    "SING": Entry(lambda i, _: i.sweeper.start(1)),
    "NUMG": Entry(_groups, 1, 1),
    "AVERREST": Entry(_restart_average),
    "DCO": Entry(_bias, 1, 1),
    "AUTO": Entry(lambda i, _: None),  # the screen's scale is drawn from the data in any case
    "DATMEM": Entry(_data_to_memory),
    "INPUDATA": Entry(_put_data, 1, 1602),
    **{f"FORM{form}": _form(form) for form in (2, 3, 4, 5)},
    **{f"COM{s}": Entry(_measure_standard(_compensation, s)) for s in STANDARDS},
    **{f"CAL{s}": Entry(_measure_standard(_calibration, s)) for s in STANDARDS},
    **{f"COMST{s}": Entry(_switch(_compensation, s), 1, 1) for s in STANDARDS},
    **{f"INPUCOMC{k}": Entry(_put_correction(_compensation, s), 1, 1602) for k, s in enumerate(STANDARDS, 1)},
    **{f"INPUCALC{k}": Entry(_put_correction(_calibration, s), 1, 1602) for k, s in enumerate(STANDARDS, 1)},
    "CALST": Entry(_switch(_calibration, "ABC"), 1, 1),
    "EDITLIST": Entry(_edit_list),
    "CLEL": Entry(_clear_list),
    "SADD": Entry(lambda i, _: i.state.begin_segment()),
    "SEDI": Entry(lambda i, u: i.state.begin_segment(_whole(u.arguments[0], 0, 99)), 1, 1),
    "SDON": Entry(lambda i, _: i.state.finish_segment()),
    "EDITDONE": Entry(_end_edit),
    **{name: Entry(act, least, most) for name, (act, least, most) in FILE_COMMANDS.items()},
}
"""Commands by mnemonic."""


# queries -------------------------------------------------------------------------------------------------------


def _complex(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Complexes:
    return values[0::2] + 1j * values[1::2]


def _both(z: Complexes) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    return seven_digits(pairs(z.real, z.imag))


def _sweep_values(instrument: Instrument, _: Unit) -> bytes:
    return encode(instrument.state.axis().values, instrument.state.form, 11)


def _point(values: np.ndarray[tuple[int, ...], np.dtype[np.float64]], width: int, unit: Unit, form: int) -> bytes:
    """Return the numbers of point n, counted from 1. Raises CommandError for a point that is not there."""
    n = round(number(unit.arguments[0]))
    if not 1 <= n <= values.size // width:
        raise CommandError(-222, "DATA OUT OF RANGE")
    return encode(values[(n - 1) * width : n * width], form, 11 if width == 1 else 6)


def _trace_values(instrument: Instrument, memory: bool = False) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    axis, z = instrument.sweeper.axis, instrument.sweeper.data
    if memory:
        if instrument.memory is None:
            raise CommandError(-230, "DATA CORRUPT OR STALE")
        axis, z = instrument.memory.axis, instrument.memory.data
    state = instrument.state
    return seven_digits(pairs(*trace(axis.frequency, z, str(state["MEAS"]), str(state["TRAC"]))))


def _memory_data(instrument: Instrument, _: Unit) -> bytes:
    if instrument.memory is None:
        raise CommandError(-230, "DATA CORRUPT OR STALE")
    return encode(_both(instrument.memory.data), instrument.state.form)


def _statistics(instrument: Instrument, _: Unit) -> bytes:
    readout = _trace_values(instrument)[0::2]
    values = np.array([readout.mean(), readout.std(ddof=1), np.ptp(readout)])
    return encode(seven_digits(values), 4)


def _correction_array(bank: Callable[[Instrument], Correction], standard: str) -> Ask:
    def ask(instrument: Instrument, _: Unit) -> bytes:
        measured = bank(instrument).measured.get(standard)
        if measured is None:
            raise CommandError(-230, "DATA CORRUPT OR STALE")
        return encode(_both(measured), instrument.state.form)

    return ask


QUERIES: Mapping[str, Entry] = {
    "*IDN": Entry(lambda i, _: i.identity),
    "*OPT": Entry(lambda i, _: "0"),
    "*OPC": Entry(lambda i, _: "1"),  # the wait itself is in Instrument.perform
    "*TST": Entry(lambda i, _: "0"),
    "*ESR": Entry(lambda i, _: str(i.status.take_standard())),
    "*ESE": Entry(lambda i, _: str(i.status.standard_enable)),
    "*SRE": Entry(lambda i, _: str(i.status.request_enable)),
    "ESB": Entry(lambda i, _: str(i.status.take_instrument())),
    "ESNB": Entry(lambda i, _: str(i.status.instrument_enable)),
    "OUTPERRO": Entry(lambda i, _: i.status.next_error()),
    "HOLD": Entry(lambda i, _: "0" if i.sweeper.running else "1"),
    "CONT": Entry(lambda i, _: "1" if i.sweeper.continuous else "0"),
    "OUTPSWPRM": Entry(_sweep_values),
    "OUTPSWPRMP": Entry(lambda i, u: _point(i.state.axis().values, 1, u, i.state.form), 1, 1),
    "OUTPDATA": Entry(lambda i, _: encode(_both(i.sweeper.data), i.state.form)),
    "OUTPDATAP": Entry(lambda i, u: _point(_both(i.sweeper.data), 2, u, i.state.form), 1, 1),
    "OUTPDTRC": Entry(lambda i, _: encode(_trace_values(i), i.state.form)),
    "OUTPDTRCP": Entry(lambda i, u: _point(_trace_values(i), 2, u, i.state.form), 1, 1),
    "OUTPMEMO": Entry(_memory_data),
    "OUTPMTRC": Entry(lambda i, _: encode(_trace_values(i, memory=True), i.state.form)),
    "OUTPMSTA": Entry(_statistics),
    **{f"COMST{s}": Entry(lambda i, _, s=s: "1" if s in i.compensation.on else "0") for s in STANDARDS},
    "CALST": Entry(lambda i, _: "1" if i.calibration.on else "0"),
    **{f"OUTPCOMC{k}": Entry(_correction_array(_compensation, s)) for k, s in enumerate(STANDARDS, 1)},
    **{f"OUTPCALC{k}": Entry(_correction_array(_calibration, s)) for k, s in enumerate(STANDARDS, 1)},
    **{name: Entry(ask, count, count) for name, (ask, count) in FILE_QUERIES.items()},
}
"""Queries by mnemonic, without the question mark."""
