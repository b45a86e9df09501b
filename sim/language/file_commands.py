"""The commands of the file system (PM p.112-118, 406-423). A name without an extension gets the one of its kind."""

from collections.abc import Callable, Mapping
from pathlib import PurePosixPath

from ..instrument.instrument import Instrument
from ..instrument.settings import number
from ..instrument.traces import trace
from .command_entry import Act, Entry
from .exports import ascii_export, binary_arrays, touchstone
from .file_system import DEVICES
from .formats import block
from .messages import CommandError, Unit, block_bytes, unquote
from .screen_picture import screen
from .state_file import recall, snapshot


def _device(instrument: Instrument) -> str:
    return str(instrument.state["STOD"])


def _name(unit: Unit) -> str:
    return unquote(unit.arguments[0])


def _file_name(instrument: Instrument, unit: Unit) -> str:
    names = instrument.disk.names(_device(instrument))
    index = round(number(unit.arguments[0]))
    return names[index - 1] if 1 <= index <= len(names) else ""


def _picture(instrument: Instrument) -> bytes:
    axis, z, measurement = instrument.sweeper.axis, instrument.sweeper.data, str(instrument.state["MEAS"])
    return screen(*(trace(axis.frequency, z, measurement, which)[0] for which in "AB"))


def _binary(instrument: Instrument) -> bytes:
    axis, z, measurement = instrument.sweeper.axis, instrument.sweeper.data, str(instrument.state["MEAS"])
    return binary_arrays(*(trace(axis.frequency, z, measurement, which) for which in "AB"))


def _touchstone(instrument: Instrument) -> bytes:
    return touchstone(instrument.sweeper.axis, instrument.sweeper.data)


def _saved_state(instrument: Instrument) -> bytes:
    return snapshot(instrument.state)


WRITERS: Mapping[str, Callable[[Instrument], bytes]] = {
    ".TXT": ascii_export,
    ".TIF": _picture,
    ".S1P": _touchstone,
    ".DAT": _binary,
    ".STA": _saved_state,
}
"""Kind of content by extension."""


def _save(extension: str) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        name = _name(unit)
        full = name if "." in name else name + extension
        instrument.disk.save(_device(instrument), full, WRITERS[extension](instrument))

    return act


def _save_again(instrument: Instrument, unit: Unit) -> None:
    """RESAVD: overwrite an existing file with the kind of data that its extension says."""
    name = _name(unit)
    instrument.disk.content(_device(instrument), name)
    writer = WRITERS.get(PurePosixPath(name).suffix.upper()[:4])
    if writer is None:
        raise CommandError(112)
    instrument.disk.save(_device(instrument), name, writer(instrument), replace=True)


def _recall(instrument: Instrument, unit: Unit) -> None:
    """RECD: restore the settings of a state file; the sweep stops. An invalid file causes a preset and error 111."""
    name = _name(unit)
    if PurePosixPath(name).suffix.upper() not in (".STA", ".DAT"):
        raise CommandError(112)
    content = instrument.disk.content(_device(instrument), name)
    if name.upper().endswith(".DAT"):
        return
    try:
        recall(instrument.state, content)
    except CommandError:
        instrument.reset(continuous=True)
        raise CommandError(111) from None
    instrument.sweeper.hold()
    instrument.new_axis()


def _copy(instrument: Instrument, unit: Unit) -> None:
    """FILC: name and device of the file, name and device of the copy."""
    name, device, new_name, new_device = (unquote(a) for a in unit.arguments)
    if not {device.upper(), new_device.upper()} <= set(DEVICES):
        raise CommandError(-224)
    instrument.disk.save(new_device.upper(), new_name, instrument.disk.content(device.upper(), name))


FILE_COMMANDS: Mapping[str, Entry] = {
    "SAVDASC": Entry(_save(".TXT"), 1, 1),
    "SAVDTIF": Entry(_save(".TIF"), 1, 1),
    "SAVDS1P": Entry(_save(".S1P"), 1, 1),
    "SAVDDAT": Entry(_save(".DAT"), 1, 1),
    "SAVDSTA": Entry(_save(".STA"), 1, 1),
    "RESAVD": Entry(_save_again, 1, 1),
    "RECD": Entry(_recall, 1, 1),
    "PURG": Entry(lambda i, u: i.disk.purge(_device(i), _name(u)), 1, 1),
    "ROPEN": Entry(lambda i, u: i.disk.open_to_read(_device(i), _name(u)), 1, 1),
    "WOPEN": Entry(lambda i, u: i.disk.open_to_write(_device(i), _name(u)), 1, 1),
    "WRITE": Entry(lambda i, u: i.disk.write(block_bytes(u.arguments[0])), 1, 1),
    "CHAD": Entry(lambda i, u: i.disk.change_directory(_device(i), _name(u)), 1, 1),
    "CRED": Entry(lambda i, u: i.disk.make_directory(_device(i), _name(u)), 1, 1),
    "FILC": Entry(_copy, 4, 4),
    "INID": Entry(lambda i, _: i.disk.format(_device(i))),
    "SAVPSTA": Entry(lambda i, _: i.disk.save("FLASH", "AUTOREC.STA", _saved_state(i), replace=True)),
    "CLOSE": Entry(lambda i, _: i.disk.close()),
}
"""Commands by mnemonic."""

FILE_QUERIES: Mapping[str, Entry] = {
    "FNUM": Entry(lambda i, _: str(len(i.disk.names(_device(i))))),
    "FNAME": Entry(_file_name, 1, 1),
    "FSIZE": Entry(lambda i, u: str(i.disk.size(_device(i), _name(u))), 1, 1),
    "CWD": Entry(lambda i, _: i.disk.directory(_device(i))),
    "READ": Entry(lambda i, _: block(i.disk.read())),
}
"""Queries by mnemonic."""
