"""Execution of program messages.

`execute` never waits. `perform` waits for `*OPC?`, for `*WAI` and for the measurement of a standard, which is not an
overlapped command (PM p.262). Only the client that sent the command waits.
"""

from collections.abc import AsyncIterator, Callable

import numpy as np

from ..instrument.instrument import Instrument
from ..instrument.list_table import FIELDS
from .command_entry import Entry
from .command_table import ROWS
from .commands import COMMANDS, LIST_EDITOR, QUERIES
from .conditions import check
from .correction_commands import BLOCKING
from .kept_commands import short_tree
from .messages import CommandError, Unit, parse

OF_THE_TABLE = frozenset({*LIST_EDITOR, *FIELDS, "SCOL", "MKRSTAR", "MKRSTOP", "MKRCENT", "MEAS", "OUTPERRO"})
"""Commands that do not discard an open segment of the list-sweep table; the manual's example sends MEAS within one."""


def _write(instrument: Instrument, unit: Unit) -> None:
    argument = b",".join(unit.arguments)
    check(instrument, unit.mnemonic, argument)
    instrument.set(unit.mnemonic, argument)


_READ_SETTING = Entry(lambda i, u: i.state.query(u.mnemonic))
_WRITE_SETTING = Entry(_write, 1, 1)
_WRITE_ADDRESS = Entry(_write, 4, 4)


def entry(instrument: Instrument, unit: Unit) -> Entry:
    """Return the table entry of a unit. Raises CommandError for an unknown mnemonic."""
    name = short_tree(unit.mnemonic) if ":" in unit.mnemonic else unit.mnemonic
    table_entry = (QUERIES if unit.query else COMMANDS).get(name)
    if table_entry is None and instrument.state.knows(name):
        table_entry = _setting(name, unit.query)
    if table_entry is None or (instrument.no_list and name in LIST_EDITOR):
        raise CommandError(-113)
    return table_entry


def _setting(name: str, query: bool) -> Entry | None:
    row = ROWS[name]
    if not query:
        return _WRITE_ADDRESS if row.kind == "ints" else _WRITE_SETTING
    return None if row.query == "none" else _READ_SETTING


def execute(instrument: Instrument, unit: Unit, message_available: bool = False) -> bytes | None:
    """Carry out one unit and return its answer, None for a command. Errors go to the error queue."""
    instrument.advance()
    try:
        if unit.header == "*STB?":  # the only query whose answer depends on the client: whether it has an unread answer
            return str(instrument.status.byte(message_available)).encode("ascii")
        found = entry(instrument, unit)
        if not (unit.query or unit.mnemonic in OF_THE_TABLE or unit.mnemonic.startswith("*")):
            _scratch(instrument)
        with np.errstate(all="ignore"):  # nonsensical settings may yield nonsensical numbers
            return found(instrument, unit)
    except CommandError as error:
        instrument.status.error(error)
        return None
    finally:
        instrument.advance()
        instrument.wake()


def _scratch(instrument: Instrument) -> None:
    """Drop an open segment of the list-sweep table and queue the error; the command is still carried out."""
    try:
        instrument.state.table.scratch()
    except CommandError as error:
        instrument.status.error(error)


async def perform(
    instrument: Instrument, message: bytes, message_available: Callable[[], bool] = lambda: False
) -> AsyncIterator[bytes]:
    """Carry out a program message; yield the answers one by one, without newlines."""
    try:
        for unit in parse(message):
            if unit.header in ("*OPC?", "*WAI"):
                await instrument.until_idle()
            answer = execute(instrument, unit, message_available())
            if unit.mnemonic in BLOCKING:
                await instrument.until_standard_measured()
            if answer is not None:
                yield answer
    except CommandError as error:
        instrument.status.error(error)
