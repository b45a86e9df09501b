"""Arrays out of the instrument and back into it (reference 2.6)."""

from collections.abc import Mapping

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ..instrument.axis import Axis
from ..instrument.instrument import Instrument, Memory
from ..instrument.settings import number
from ..instrument.traces import trace
from .command_entry import Entry
from .formats import decode, encode, pairs, seven_digits
from .messages import CommandError, Unit

ARRAY_PARAMETERS = 1602
"""Numbers of the longest array as ASCII parameters: 801 complex ones."""


def as_complex(values: Reals) -> Complexes:
    """Return numbers that came as pairs, shape (2N,), as complex ones, shape (N,)."""
    return values[0::2] + 1j * values[1::2]


def as_pairs(z: Complexes) -> Reals:
    """Return complex numbers, shape (N,), as pairs of seven digits, shape (2N,)."""
    return seven_digits(pairs(z.real, z.imag))


def _point(values: Reals, width: int, unit: Unit, form: int) -> bytes:
    """Return the numbers of point n, counted from 1. Raises CommandError for a point that is not there."""
    n = round(number(unit.arguments[0]))
    if not 1 <= n <= values.size // width:
        raise CommandError(-222, "DATA OUT OF RANGE")
    return encode(values[(n - 1) * width : n * width], form, 11 if width == 1 else 6)


def _memory(instrument: Instrument) -> Memory:
    if instrument.memory is None:
        raise CommandError(-230, "DATA CORRUPT OR STALE")
    return instrument.memory


def _trace(instrument: Instrument, axis: Axis, z: Complexes) -> Reals:
    """Return the active trace of these data: readout and subsidiary in pairs, shape (2N,)."""
    state = instrument.state
    return seven_digits(pairs(*trace(axis.frequency, z, str(state["MEAS"]), str(state["TRAC"]))))


def _data_trace(instrument: Instrument) -> Reals:
    return _trace(instrument, instrument.sweeper.axis, instrument.sweeper.data)


def _memory_trace(instrument: Instrument, _: Unit) -> bytes:
    memory = _memory(instrument)
    return encode(_trace(instrument, memory.axis, memory.data), instrument.state.form)


def _statistics(instrument: Instrument, _: Unit) -> bytes:
    readout = _data_trace(instrument)[0::2]
    return encode(seven_digits(np.array([readout.mean(), readout.std(ddof=1), np.ptp(readout)])), 4)


def _copy_to_memory(instrument: Instrument, _: Unit) -> None:
    instrument.memory = Memory(instrument.sweeper.axis, instrument.sweeper.data)


def _put_data(instrument: Instrument, unit: Unit) -> None:
    axis = instrument.state.axis()
    z = as_complex(decode(unit.arguments, instrument.state.form, 2 * axis.values.size))
    instrument.sweeper.axis, instrument.sweeper.data = axis, z


def _put_trace(instrument: Instrument, unit: Unit) -> None:
    """INPUDTRC: possible where the trace is the data array itself."""
    if instrument.state["MEAS"] != "COMP" or instrument.state["TRAC"] != "A":
        raise CommandError(-221, "SETTINGS CONFLICT; MEAS COMP AND TRAC A FIRST")
    _put_data(instrument, unit)


def _form(form: int) -> Entry:
    def act(instrument: Instrument, _: Unit) -> None:
        instrument.state.form = form

    return Entry(act)


DATA_COMMANDS: Mapping[str, Entry] = {
    **{f"FORM{form}": _form(form) for form in (2, 3, 4, 5)},
    "DATMEM": Entry(_copy_to_memory),
    "INPUDATA": Entry(_put_data, 1, ARRAY_PARAMETERS),
    "INPUDTRC": Entry(_put_trace, 1, ARRAY_PARAMETERS),
}
"""Commands by mnemonic."""

DATA_QUERIES: Mapping[str, Entry] = {
    "OUTPSWPRM": Entry(lambda i, _: encode(i.state.axis().values, i.state.form, 11)),
    "OUTPSWPRMP": Entry(lambda i, u: _point(i.state.axis().values, 1, u, i.state.form), 1, 1),
    "OUTPDATA": Entry(lambda i, _: encode(as_pairs(i.sweeper.data), i.state.form)),
    "OUTPDATAP": Entry(lambda i, u: _point(as_pairs(i.sweeper.data), 2, u, i.state.form), 1, 1),
    "OUTPDTRC": Entry(lambda i, _: encode(_data_trace(i), i.state.form)),
    "OUTPDTRCP": Entry(lambda i, u: _point(_data_trace(i), 2, u, i.state.form), 1, 1),
    "OUTPMEMO": Entry(lambda i, _: encode(as_pairs(_memory(i).data), i.state.form)),
    "OUTPMTRC": Entry(_memory_trace),
    "OUTPMSTA": Entry(_statistics),
}
"""Queries by mnemonic."""
