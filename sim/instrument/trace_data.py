"""Contents of the two traces: data and memory, in the measurement parameters of MEAS, with the arithmetic of DISP."""

from typing import TYPE_CHECKING

import numpy as np

from ...models.base.arrays import Reals
from ..language.formats import seven_digits
from ..language.messages import CommandError
from .traces import TRACES, trace

if TYPE_CHECKING:
    from .instrument import Instrument

PHASES = ("theta_z", "theta_y")


def quantity(instrument: "Instrument", which: str | None = None) -> str:
    """Return the quantity of a trace: a name of `traces.QUANTITIES`, or `complex` (MEAS COMP)."""
    state = instrument.state
    measurement = str(state["MEAS"])
    if measurement == "COMP":
        return "complex"
    return TRACES[measurement][0 if (which or state["TRAC"]) == "A" else 1]


def data_trace(instrument: "Instrument", which: str | None = None) -> tuple[Reals, Reals]:
    """Return readout and second readout of a trace (the active one unless given), each of shape (N,)."""
    state, sweeper = instrument.state, instrument.sweeper
    which = which or str(state["TRAC"])
    if which in sweeper.written:
        pairs = sweeper.written[which]
        return pairs[0::2], pairs[1::2]
    first, second = trace(sweeper.axis.frequency, sweeper.data, str(state["MEAS"]), which)
    first, second = _with_memory(instrument, which, first, second)
    if state["MEAS"] != "COMP":
        first = first - float(state.of_trace("DATOVAL", which))
    return seven_digits(first), seven_digits(second)


def _with_memory(instrument: "Instrument", which: str, first: Reals, second: Reals) -> tuple[Reals, Reals]:
    """Return the data after the arithmetic selected by DISP (PM p.301)."""
    shown = instrument.display[which]
    if shown not in ("DMNM", "DELP", "DDVM") or instrument.memory is None:
        return first, second
    kept_first, kept_second = memory_trace(instrument, which)
    with np.errstate(all="ignore"):
        if shown == "DMNM":
            return first - kept_first, second - kept_second
        if shown == "DELP":
            return np.nan_to_num(100 * (first - kept_first) / kept_first), second
        ratio = np.nan_to_num((first + 1j * second) / (kept_first + 1j * kept_second))
        return ratio.real, ratio.imag


def memory_trace(instrument: "Instrument", which: str | None = None) -> tuple[Reals, Reals]:
    """Return readout and second readout of the memory trace. Raises CommandError where there is none."""
    if instrument.memory is None:
        raise CommandError(34)
    memory, state = instrument.memory, instrument.state
    first, second = trace(memory.axis.frequency, memory.data, str(state["MEAS"]), which or str(state["TRAC"]))
    return seven_digits(first), seven_digits(second)
