"""The command table: reset, status, sweep, bias and list sweep are defined here, the others in modules by subject.

Plain settings are in `settings.TABLE`.
"""

from collections.abc import Mapping

from ..instrument.equivalent_circuit import EQUIVALENT_COMMANDS
from ..instrument.instrument import Instrument
from ..instrument.settings import Number, Switch, number, whole
from ..instrument.status import OPC
from ..instrument.sweep_run import FOREVER
from ..instrument.sweep_timing import point_seconds
from .analysis_commands import ANALYSIS_COMMANDS, ANALYSIS_QUERIES
from .command_entry import Act, Entry
from .correction_commands import CORRECTION_COMMANDS, CORRECTION_QUERIES
from .data_commands import DATA_COMMANDS, DATA_QUERIES
from .file_commands import FILE_COMMANDS, FILE_QUERIES
from .formats import printed
from .kept_commands import KEPT_COMMANDS, KEPT_QUERIES
from .limit_commands import LIMIT_COMMANDS, LIMIT_QUERIES
from .marker_commands import MARKER_COMMANDS, MARKER_QUERIES
from .messages import CommandError, Unit
from .screen_commands import SCREEN_COMMANDS, SCREEN_QUERIES

RANGE_AMPERE = {"M1": 1e-3, "M10": 10e-3, "M100": 100e-3}
BIAS_OHM = 2e3
"""Resistance through which the bias charges the device; it sets the range that a bias voltage needs [assumption]."""


def _trigger(instrument: Instrument, _: Unit) -> None:
    if instrument.state["TRGS"] != "BUS" or not instrument.sweeper.trigger():
        raise CommandError(-211)


def _start(sweeps: int) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        _start_sweeps(instrument, sweeps)

    return act


def _start_group(instrument: Instrument, unit: Unit) -> None:
    _start_sweeps(instrument, whole(unit.arguments[0], 1, 999))


def _start_sweeps(instrument: Instrument, sweeps: int) -> None:
    """Begin sweeps. Raises CommandError where a standard is being measured: initiation is ignored."""
    if instrument.sweeper.measures_standard:
        raise CommandError(-213)
    instrument.sweeper.start(sweeps)


def _operation_complete(instrument: Instrument, _: Unit) -> None:
    if instrument.sweeper.seconds_left() > 0:
        instrument.opc_wanted = True
    else:
        instrument.status.raise_standard(OPC)


def _clear(instrument: Instrument, _: Unit) -> None:
    instrument.status.clear()
    instrument.opc_wanted = False


def _bias(instrument: Instrument, unit: Unit) -> None:
    """DCO ON is refused with 137 where the bias needs more current than the range supplies."""
    state = instrument.state
    if Switch(False).parse(unit.arguments[0]):
        voltage = str(state["DCMOD"]).endswith("VOLT")
        ampere = abs(state.real("DCV")) / BIAS_OHM if voltage else abs(state.real("DCI"))
        if instrument.bias_overload or ampere > RANGE_AMPERE[str(state["DCRNG"])]:
            raise CommandError(137)
        constant = str(state["DCMOD"]).startswith("C") and state["DCMOD"] != "CURR"
        if constant and voltage and not state.real("MINDCV") <= state.real("DCV") <= state.real("MAXDCV"):
            raise CommandError(138)
    instrument.set("DCO", unit.arguments[0])


def _end_edit(instrument: Instrument, _: Unit) -> None:
    in_use = instrument.state["SWPT"] == "LIST"
    before = instrument.state.table.segments
    try:
        instrument.state.table.done(in_use)
    finally:
        if in_use and instrument.state.table.segments is not before:
            instrument.new_axis()
            instrument.sweeper.restart()


def _number(unit: Unit) -> int | None:
    return round(number(unit.arguments[0])) if unit.arguments else None


def _manual_point(instrument: Instrument, unit: Unit) -> None:
    sweeper = instrument.sweeper
    sweeper.manual_point, sweeper.manual_range = whole(unit.arguments[0], 1, sweeper.axis.values.size), (0, 0)


def _manual_range(instrument: Instrument, unit: Unit) -> None:
    """MANR: 0,0 means the point of MANP; other numbers are clamped to the sweep (PM p.346)."""
    numbers = [round(number(a)) for a in unit.arguments]
    most = instrument.sweeper.axis.values.size
    inside = (0, 0) if numbers == [0, 0] else (max(min(numbers[0], most), 1), max(min(numbers[1], most), 1))
    instrument.sweeper.manual_range = inside if inside[0] < inside[1] else (inside[1], inside[1])


def _sweep_time(instrument: Instrument, _: Unit) -> str:
    seconds = point_seconds(instrument.state.axis(), instrument.state.real("PDELT")).sum()
    return printed(float(seconds) + instrument.state.real("SDELT"))


def _set_sweep_time(instrument: Instrument, unit: Unit) -> None:
    """SWET: time beyond what the sweep needs is spread over its points as delay."""
    wished = Number(0.0, 1e4, 0.0, "S", 1e-3).parse(unit.arguments[0])
    axis = instrument.state.axis()
    spare = wished - float(point_seconds(axis).sum()) - instrument.state.real("SDELT")
    instrument.set("PDELT", repr(max(spare, 0.0) / axis.values.size).encode("ascii"))


def _enable(name: str, limit: int) -> Entry:
    return Entry(lambda i, u: setattr(i.status, name, whole(u.arguments[0], 0, limit)), 1, 1)


LIST_EDITOR: Mapping[str, Entry] = {
    "EDITLIST": Entry(lambda i, _: i.state.table.start()),
    "CLEL": Entry(lambda i, _: i.state.table.clear()),
    "SEGM": Entry(lambda i, u: i.state.table.choose(whole(u.arguments[0], 1, 99)), 1, 1),
    "SADD": Entry(lambda i, u: i.state.table.add(i.state.first_segment(), _number(u)), 0, 1),
    "SEDI": Entry(lambda i, u: i.state.table.open(_number(u)), 0, 1),
    "SDEL": Entry(lambda i, u: i.state.table.delete(_number(u)), 0, 1),
    "SDON": Entry(lambda i, _: i.state.table.finish()),
    "EDITDONE": Entry(_end_edit),
}
"""Commands that edit the list-sweep table (PM p.44-45)."""

COMMANDS: Mapping[str, Entry] = {
    "*RST": Entry(lambda i, _: i.reset(continuous=False)),
    "PRES": Entry(lambda i, _: i.reset(continuous=True)),
    "*CLS": Entry(_clear),
    "CLES": Entry(_clear),
    "*OPC": Entry(_operation_complete),
    "*WAI": Entry(lambda i, _: None),  # the wait itself is in dialect.perform
    "*TRG": Entry(_trigger),
    "*ESE": _enable("standard_enable", 255),
    "*SRE": _enable("request_enable", 255),
    "ESNB": _enable("instrument_enable", 65535),
    "HOLD": Entry(lambda i, _: i.sweeper.hold()),
    "CONT": Entry(_start(FOREVER)),
    "SING": Entry(_start(1)),
    "NUMG": Entry(_start_group, 1, 1),
    "MANP": Entry(_manual_point, 1, 1),
    "MANR": Entry(_manual_range, 2, 2),
    "SWET": Entry(_set_sweep_time, 1, 1),
    "AVERREST": Entry(lambda i, _: i.sweeper.restart()),
    "DCO": Entry(_bias, 1, 1),
    **KEPT_COMMANDS,
    **LIST_EDITOR,
    **SCREEN_COMMANDS,
    **MARKER_COMMANDS,
    **ANALYSIS_COMMANDS,
    **LIMIT_COMMANDS,
    **DATA_COMMANDS,
    **CORRECTION_COMMANDS,
    **EQUIVALENT_COMMANDS,
    **FILE_COMMANDS,
}
"""Commands by mnemonic."""

QUERIES: Mapping[str, Entry] = {
    "*IDN": Entry(lambda i, _: i.identity),
    "*OPT": Entry(lambda i, _: '""'),
    "*OPC": Entry(lambda i, _: "1"),  # the wait itself is in dialect.perform
    "*TST": Entry(lambda i, _: "0"),
    "*ESR": Entry(lambda i, _: str(i.status.take_standard())),
    "*ESE": Entry(lambda i, _: str(i.status.standard_enable)),
    "*SRE": Entry(lambda i, _: str(i.status.request_enable)),
    "ESB": Entry(lambda i, _: str(i.status.take_instrument())),
    "ESNB": Entry(lambda i, _: str(i.status.instrument_enable)),
    "OUTPERRO": Entry(lambda i, _: i.status.next_error()),
    "CONT": Entry(lambda i, _: "1" if i.sweeper.continuous else "0"),
    "HOLD": Entry(lambda i, _: "1" if i.sweeper.running is None else "0"),
    "MANP": Entry(lambda i, _: str(i.sweeper.manual_point)),
    "MANR": Entry(lambda i, _: ",".join(map(str, i.sweeper.manual_range))),
    "SWET": Entry(_sweep_time),
    "SEGM": Entry(lambda i, _: str(i.state.table.target)),
    "STOD": Entry(lambda i, _: str(i.state["STOD"])),
    **KEPT_QUERIES,
    **SCREEN_QUERIES,
    **MARKER_QUERIES,
    **ANALYSIS_QUERIES,
    **LIMIT_QUERIES,
    **DATA_QUERIES,
    **CORRECTION_QUERIES,
    **FILE_QUERIES,
}
"""Queries by mnemonic, without the question mark."""
