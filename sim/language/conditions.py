"""Conditions under which a command is carried out, by the names in the column `needs` of the command reference."""

from collections.abc import Callable, Mapping

from ..instrument.instrument import Instrument
from ..instrument.markers import active
from ..instrument.trace_data import PHASES, quantity
from .command_table import ROWS
from .messages import CommandError


def _all_zero_span(instrument: Instrument) -> bool:
    segments = instrument.state.table.segments
    return bool(segments) and all(s.start == s.stop for s in segments)


CONDITIONS: Mapping[str, tuple[int, Callable[[Instrument], bool]]] = {
    "marker": (98, lambda i: active(i).on),
    "phase": (87, lambda i: quantity(i) in PHASES or (i.state["MEAS"] == "COMP" and _format(i) == "POLA")),
    "scalar": (83, lambda i: i.state["MEAS"] != "COMP"),
    "list": (132, lambda i: i.state["SWPT"] == "LIST"),
    "list-span": (130, lambda i: not _all_zero_span(i)),
    "memory": (34, lambda i: i.memory is not None),
    "memory-shown": (94, lambda i: i.memory is not None and i.display[str(i.state["TRAC"])] in ("MEMO", "DATM")),
    "port-c-out": (142, lambda i: i.state.radios["COUT"]),
    "port-d-out": (142, lambda i: i.state.radios["DOUT"]),
    "port-c-in": (142, lambda i: i.state.radios["CIN"]),
    "port-d-in": (142, lambda i: i.state.radios["DIN"]),
}
"""The error raised where the condition does not hold, and the test."""


def _format(instrument: Instrument) -> str:
    return instrument.formats[str(instrument.state["TRAC"])]


def check(instrument: Instrument, mnemonic: str, argument: bytes = b"") -> None:
    """Raise CommandError where a command cannot be carried out now.

    DATA needs no memory: MKRO and SCAF then keep their values.
    """
    row = ROWS.get(mnemonic)
    if row is None or argument.upper() == b"DATA":
        return
    for name in row.needs:
        number, holds = CONDITIONS[name]
        if not holds(instrument):
            raise CommandError(number)
