"""Commands that read and write arrays (reference 2.6)."""

from collections.abc import Callable, Mapping

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ..instrument.instrument import Instrument, Memory
from ..instrument.settings import number
from ..instrument.trace_data import data_trace, memory_trace
from .command_entry import Ask, Entry
from .formats import decode, encode, pairs, seven_digits
from .messages import CommandError, Unit

ARRAY_PARAMETERS = 1602
"""Numbers in the longest array sent as ASCII parameters: 801 complex points."""


def as_complex(values: Reals) -> Complexes:
    """Return pairs of numbers, shape (2N,), as complex numbers, shape (N,)."""
    return values[0::2] + 1j * values[1::2]


def as_pairs(z: Complexes) -> Reals:
    """Return complex numbers, shape (N,), as pairs of seven digits, shape (2N,)."""
    return seven_digits(pairs(z.real, z.imag))


def _point(values: Reals, width: int, unit: Unit, form: int) -> bytes:
    """Return the numbers of point n, counted from 1. Raises CommandError where there is no such point."""
    n = round(number(unit.arguments[0]))
    if not 1 <= n <= values.size // width:
        raise CommandError(-222)
    return encode(values[(n - 1) * width : n * width], form)


def _memory(instrument: Instrument) -> Memory:
    if instrument.memory is None:
        raise CommandError(34)
    return instrument.memory


def _monitored(name: str) -> Callable[[Instrument], Reals]:
    def values(instrument: Instrument) -> Reals:
        readings: Reals = getattr(instrument.sweeper.monitors, name)
        return readings if readings.size else np.zeros(instrument.sweeper.axis.values.size)

    return values


ARRAYS: Mapping[str, tuple[int, Callable[[Instrument], Reals]]] = {
    "OUTPSWPRM": (1, lambda i: i.state.axis().values),
    "OUTPDATA": (2, lambda i: as_pairs(i.sweeper.data)),
    "OUTPDTRC": (2, lambda i: pairs(*data_trace(i))),
    "OUTPMEMO": (2, lambda i: as_pairs(_memory(i).data)),
    "OUTPMTRC": (2, lambda i: pairs(*memory_trace(i))),
    "OUTPVAC": (1, _monitored("volts")),
    "OUTPIAC": (1, _monitored("amperes")),
    "OUTPDC": (1, _monitored("bias")),
}
"""Numbers at each point, and the array; a query that ends in P reads one point."""


def _whole_array(values: Callable[[Instrument], Reals]) -> Ask:
    return lambda instrument, _: encode(values(instrument), instrument.state.form)


def _one_point(width: int, values: Callable[[Instrument], Reals]) -> Ask:
    return lambda instrument, unit: _point(values(instrument), width, unit, instrument.state.form)


def _put_data(instrument: Instrument, unit: Unit) -> None:
    axis = instrument.state.axis()
    z = as_complex(decode(unit.arguments, instrument.state.form, 2 * axis.values.size))
    instrument.sweeper.axis, instrument.sweeper.data = axis, z


def _put_trace(instrument: Instrument, unit: Unit) -> None:
    """INPUDTRC: write the data trace of the active trace, whatever its quantity; the data array stays."""
    count = instrument.sweeper.axis.values.size
    instrument.sweeper.written[str(instrument.state["TRAC"])] = decode(unit.arguments, instrument.state.form, 2 * count)


def _form(form: int) -> Entry:
    def act(instrument: Instrument, _: Unit) -> None:
        instrument.state.form = form

    return Entry(act)


DATA_COMMANDS: Mapping[str, Entry] = {
    **{f"FORM{form}": _form(form) for form in (2, 3, 4, 5)},
    "INPUDATA": Entry(_put_data, 1, ARRAY_PARAMETERS),
    "INPUDTRC": Entry(_put_trace, 1, ARRAY_PARAMETERS),
}
"""Commands by mnemonic."""

DATA_QUERIES: Mapping[str, Entry] = {
    **{name: Entry(_whole_array(values)) for name, (_, values) in ARRAYS.items()},
    **{f"{name}P": Entry(_one_point(width, values), 1, 1) for name, (width, values) in ARRAYS.items()},
}
"""Queries by mnemonic."""
