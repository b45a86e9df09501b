"""Files of the instrument: its screen as TIFF, its last sweep in its own formats.

It saves to its RAM disk and transfers a file in blocks of at most 16384 bytes (Programming Manual p.83, p.113).
Saving to an existing name is an error, so the file is removed before saving and again after it has been read.
"""

from ..base.analyzer import FileKind, InstrumentError
from ..visa import replies
from ..visa.connection import Connection
from .protocol import error_queue as errorqueue
from .protocol.settings import LENGTH_DIGITS

BLOCK_BYTES = 16_384

_SAVE: dict[FileKind, tuple[str, str]] = {
    "screen": ("PRIC VARI;SAVDTIF", "pzctl.tif"),
    "ascii": ("SAVDASC", "pzctl.txt"),
    "binary": ("SAVDDAT", "pzctl.dat"),
    "touchstone": ("SAVDS1P", "pzctl.s1p"),
}
"""Command and file name (8.3) for each kind of file."""


def fetch(link: Connection, kind: FileKind) -> bytes:
    """Return the instrument's file of its screen or of its last sweep. Raises InstrumentError."""
    if kind not in _SAVE:
        raise InstrumentError(f"{link.name}: no file of kind {kind!r}; there are {', '.join(_SAVE)}")
    command, name = _SAVE[kind]
    _purge(link, name)
    link.ask(f'{command} "{name}";*OPC?')
    errorqueue.check(link, f"after {command}")
    data = read(link, name)
    _purge(link, name)
    return data


def read(link: Connection, name: str) -> bytes:
    """Return the content of the file `name` on the RAM disk. Raises InstrumentError."""
    what = f'{link.name}: FSIZE? "{name}"'
    size = replies.integer(link.ask(f'STOD MEMO;ROPEN "{name}";FSIZE? "{name}"'), what)
    data = bytearray()
    while len(data) < size:
        block = link.ask_block("READ?", BLOCK_BYTES, LENGTH_DIGITS)
        if not block:
            raise InstrumentError(f"{link.name}: {name} ends after {len(data)} bytes; {size} bytes were announced")
        data += block
    errorqueue.check(link, f"after reading {name}")
    if len(data) != size:
        raise InstrumentError(f"{link.name}: {len(data)} bytes of {name} came; {size} bytes were announced")
    return bytes(data)


def _purge(link: Connection, name: str) -> None:
    """Remove the file `name` if it exists. The only error ignored here is that it does not."""
    link.ask(f'STOD MEMO;PURG "{name}";*OPC?')
    errorqueue.drain(link)
