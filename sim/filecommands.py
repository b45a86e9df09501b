"""The commands of the file system (reference 2.9); names may come with or without their extension."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, TypeAlias

from .formats import block
from .messages import Unit, block_bytes, unquote
from .settings import number

if TYPE_CHECKING:
    from .instrument import Instrument

Act: TypeAlias = "Callable[[Instrument, Unit], None]"
Ask: TypeAlias = "Callable[[Instrument, Unit], bytes | str]"


def _device(instrument: "Instrument") -> str:
    return str(instrument.state["STOD"])


def _name(unit: Unit) -> str:
    return unquote(unit.arguments[0])


def _count(instrument: "Instrument", _: Unit) -> str:
    return str(len(instrument.disk.names(_device(instrument))))


def _file_name(instrument: "Instrument", unit: Unit) -> str:
    names = instrument.disk.names(_device(instrument))
    index = round(number(unit.arguments[0]))
    return f'"{names[index - 1]}"' if 1 <= index <= len(names) else '""'


FILE_COMMANDS: Mapping[str, tuple[Act, int, int]] = {
    "PURG": (lambda i, u: i.disk.purge(_device(i), _name(u)), 1, 1),
    "ROPEN": (lambda i, u: i.disk.open_to_read(_device(i), _name(u)), 1, 1),
    "WOPEN": (lambda i, u: i.disk.open_to_write(_device(i), _name(u)), 1, 1),
    "WRITE": (lambda i, u: i.disk.write(block_bytes(u.arguments[0])), 1, 1),
    "CLOSE": (lambda i, _: i.disk.close(), 0, 0),
}
"""Mnemonic -> what it does, least and most parameters."""

FILE_QUERIES: Mapping[str, tuple[Ask, int]] = {
    "FNUM": (_count, 0),
    "FNAME": (_file_name, 1),
    "FSIZE": (lambda i, u: str(len(i.disk.content(_device(i), _name(u)))), 1),
    "READ": (lambda i, _: block(i.disk.read()), 0),
}
"""Mnemonic -> what it answers, and how many parameters it takes."""
