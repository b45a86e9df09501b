"""The command table: reset, status, sweep, bias and list sweep here, the rest from the modules of its own subject.

Plain settings are not here: `settings.TABLE` has them.
"""

from collections.abc import Mapping

from ..instrument.equivalent_circuit import EQUIVALENT_COMMANDS, EQUIVALENT_QUERIES
from ..instrument.instrument import Instrument
from ..instrument.settings import number
from ..instrument.status import OPC
from ..instrument.sweep_run import FOREVER
from .command_entry import Entry
from .correction_commands import CORRECTION_COMMANDS, CORRECTION_QUERIES
from .data_commands import DATA_COMMANDS, DATA_QUERIES
from .file_commands import FILE_COMMANDS, FILE_QUERIES
from .messages import CommandError, Unit

RANGE_AMPERE = {"M1": 1e-3, "M10": 10e-3, "M100": 100e-3}
BIAS_OHM = 2e3
"""Resistance that the bias charges the device through: what a bias voltage asks of the range [our assumption]."""


def _whole(argument: bytes, low: int, high: int) -> int:
    return round(min(max(number(argument), low), high))


def _trigger(instrument: Instrument, _: Unit) -> None:
    if instrument.state["TRGS"] != "BUS" or not instrument.sweeper.trigger():
        raise CommandError(-211, "TRIGGER IGNORED")


def _manual_trigger(instrument: Instrument, _: Unit) -> None:
    if instrument.state["TRGS"] != "MAN" or not instrument.sweeper.trigger():
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
            raise CommandError(137, "DC BIAS OVERLOAD")
    instrument.set("DCO", unit.arguments[0])


def _end_edit(instrument: Instrument, _: Unit) -> None:
    in_use = instrument.state["SWPT"] == "LIST"
    instrument.state.table.done(in_use)
    if in_use:
        instrument.new_axis()
        instrument.sweeper.restart()


def _clear_list(instrument: Instrument, _: Unit) -> None:
    if instrument.state["SWPT"] == "LIST":
        raise CommandError(-221, "SETTINGS CONFLICT; LIST SWEEP IS ON")
    instrument.state.table.clear()


def _enable(name: str, limit: int) -> Entry:
    return Entry(lambda i, u: setattr(i.status, name, _whole(u.arguments[0], 0, limit)), 1, 1)


LIST_EDITOR: Mapping[str, Entry] = {
    "EDITLIST": Entry(lambda i, _: i.state.table.edit()),
    "CLEL": Entry(_clear_list),
    "SADD": Entry(lambda i, _: i.state.begin_segment()),
    "SEDI": Entry(lambda i, u: i.state.begin_segment(_whole(u.arguments[0], 0, 99)), 1, 1),
    "SDON": Entry(lambda i, _: i.state.table.finish()),
    "EDITDONE": Entry(_end_edit),
}
"""Commands that edit the list-sweep table [those of the 4395A: no public source gives the 4294A's]."""

COMMANDS: Mapping[str, Entry] = {
    "*RST": Entry(lambda i, _: i.reset(continuous=False)),
    "PRES": Entry(lambda i, _: i.reset(continuous=True)),
    "*CLS": Entry(_clear),
    "CLES": Entry(_clear),
    "*OPC": Entry(_operation_complete),
    "*WAI": Entry(lambda i, _: None),  # the wait itself is in dialect.perform
    "*TRG": Entry(_trigger),
    "MAN": Entry(_manual_trigger),
    "*ESE": _enable("standard_enable", 255),
    "*SRE": _enable("request_enable", 255),
    "ESNB": _enable("instrument_enable", 65535),
    "HOLD": Entry(lambda i, _: i.sweeper.hold()),
    "CONT": Entry(lambda i, _: i.sweeper.start(FOREVER)),
    "SING": Entry(lambda i, _: i.sweeper.start(1)),
    "NUMG": Entry(lambda i, u: i.sweeper.start(_whole(u.arguments[0], 1, 999)), 1, 1),
    "AVERREST": Entry(lambda i, _: i.sweeper.restart()),
    "DCO": Entry(_bias, 1, 1),
    "AUTO": Entry(lambda i, _: None),  # the picture is scaled to its data in any case
    "MKRO": Entry(lambda i, _: None, 0, 1),  # a marker is on the screen alone
    **LIST_EDITOR,
    **DATA_COMMANDS,
    **CORRECTION_COMMANDS,
    **EQUIVALENT_COMMANDS,
    **FILE_COMMANDS,
}
"""Commands by mnemonic."""

QUERIES: Mapping[str, Entry] = {
    "*IDN": Entry(lambda i, _: i.identity),
    "*OPT": Entry(lambda i, _: "0"),
    "*OPC": Entry(lambda i, _: "1"),  # the wait itself is in dialect.perform
    "*TST": Entry(lambda i, _: "0"),
    "*ESR": Entry(lambda i, _: str(i.status.take_standard())),
    "*ESE": Entry(lambda i, _: str(i.status.standard_enable)),
    "*SRE": Entry(lambda i, _: str(i.status.request_enable)),
    "ESB": Entry(lambda i, _: str(i.status.take_instrument())),
    "ESNB": Entry(lambda i, _: str(i.status.instrument_enable)),
    "OUTPERRO": Entry(lambda i, _: i.status.next_error()),
    "CONT": Entry(lambda i, _: "1" if i.sweeper.continuous else "0"),
    **DATA_QUERIES,
    **CORRECTION_QUERIES,
    **EQUIVALENT_QUERIES,
    **FILE_QUERIES,
}
"""Queries by mnemonic, without the question mark."""
