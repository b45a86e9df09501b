"""Format, scale and arithmetic of the traces on the screen (PM p.268, 301, 315, 408-423)."""

from collections.abc import Mapping

from ..instrument import display_scale
from ..instrument.instrument import Instrument, Memory
from ..instrument.settings import Choice
from ..instrument.trace_data import data_trace
from .command_entry import Act, Ask, Entry
from .formats import printed
from .messages import CommandError, Unit

FORMATS = Choice(("LINY", "LOGY", "POLA", "COMP"), "LINY")
DISPLAYS = Choice(("DATA", "MEMO", "DATM", "DMNM", "DELP", "DDVM"), "DATA")


def _set_format(instrument: Instrument, unit: Unit) -> None:
    form, complex_plane = FORMATS.parse(unit.arguments[0]), instrument.state["MEAS"] == "COMP"
    if complex_plane != (form in ("POLA", "COMP")):
        raise CommandError(85 if complex_plane else 86)
    instrument.formats[str(instrument.state["TRAC"])] = form


def _set_display(instrument: Instrument, unit: Unit) -> None:
    shown = DISPLAYS.parse(unit.arguments[0])
    if shown != "DATA" and instrument.memory is None:
        raise CommandError(34)
    if shown == "DELP" and instrument.state["MEAS"] == "COMP":
        raise CommandError(83)
    if shown == "DDVM" and instrument.state["MEAS"] != "COMP":
        raise CommandError(84)
    instrument.display[str(instrument.state["TRAC"])] = shown


def _copy_to_memory(instrument: Instrument, _: Unit) -> None:
    instrument.memory = Memory(instrument.sweeper.axis, instrument.sweeper.data)


def _auto(instrument: Instrument, _: Unit) -> None:
    shown = data_trace(instrument)[0]
    display_scale.fit(instrument, float(shown.min()), float(shown.max()))


def _set_scale(name: str) -> Act:
    return lambda instrument, unit: display_scale.put(instrument, name, unit.arguments[0])


def _scale(name: str) -> Ask:
    return lambda instrument, _: printed(display_scale.get(instrument, name))


SCREEN_COMMANDS: Mapping[str, Entry] = {
    "AUTO": Entry(_auto),
    "FMT": Entry(_set_format, 1, 1),
    "DISP": Entry(_set_display, 1, 1),
    "DATMEM": Entry(_copy_to_memory),
    **{name: Entry(_set_scale(name), 1, 1) for name in display_scale.LIMITS},
}
"""Commands by mnemonic."""

SCREEN_QUERIES: Mapping[str, Entry] = {
    "FMT": Entry(lambda i, _: i.formats[str(i.state["TRAC"])]),
    "DISP": Entry(lambda i, _: i.display[str(i.state["TRAC"])]),
    **{name: Entry(_scale(name)) for name in display_scale.LIMITS},
}
"""Queries by mnemonic, without the question mark."""
