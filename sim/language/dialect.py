"""Execution of program messages.

Commands that take time are overlapped: `execute` never waits. `perform` waits for `*OPC?` and `*WAI`, so they hold up
only the client that sent them.
"""

from collections.abc import AsyncIterator, Callable

from ..instrument.instrument import Instrument
from ..instrument.status import USER_REQUEST
from .command_entry import Entry
from .commands import COMMANDS, LIST_EDITOR, QUERIES
from .messages import CommandError, Unit, parse

_READ_SETTING = Entry(lambda i, u: i.state.query(u.mnemonic))
_WRITE_SETTING = Entry(lambda i, u: i.set(u.mnemonic, u.arguments[0]), 1, 1)


def entry(instrument: Instrument, unit: Unit) -> Entry:
    """Return the table entry of a unit. Raises CommandError for an unknown mnemonic."""
    table_entry = (QUERIES if unit.query else COMMANDS).get(unit.mnemonic)
    if table_entry is None and instrument.state.knows(unit.mnemonic):
        table_entry = _READ_SETTING if unit.query else _WRITE_SETTING
    if table_entry is None or (instrument.no_list and unit.mnemonic in LIST_EDITOR):
        raise CommandError(-113, "UNDEFINED HEADER")
    return table_entry


def execute(instrument: Instrument, unit: Unit, message_available: bool = False) -> bytes | None:
    """Carry out one unit and return its answer, None for a command. Errors go to the error queue."""
    instrument.advance()
    try:
        if unit.header == "*STB?":  # the only query whose answer depends on the client: has it an unread answer?
            return str(instrument.status.byte(message_available)).encode("ascii")
        return entry(instrument, unit)(instrument, unit)
    except CommandError as error:
        instrument.status.error(error)
        return None
    finally:
        instrument.advance()
        instrument.wake()


async def perform(
    instrument: Instrument, message: bytes, message_available: Callable[[], bool] = lambda: False
) -> AsyncIterator[bytes]:
    """Carry out a program message; yield the answers one by one, without their newline."""
    try:
        for unit in parse(message):
            if unit.header in ("*OPC?", "*WAI"):
                await instrument.until_idle()
            answer = execute(instrument, unit, message_available())
            if answer is not None:
                yield answer
    except CommandError as error:
        instrument.status.error(error)


def panel(instrument: Instrument, message: bytes) -> None:
    """Carry out the commands of a message as a person at the front panel does, and set the user-request bit."""
    instrument.status.raise_standard(USER_REQUEST)
    try:
        for unit in parse(message):
            execute(instrument, unit)
    except CommandError as error:
        instrument.status.error(error)
