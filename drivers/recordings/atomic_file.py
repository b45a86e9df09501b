"""Files that appear whole or not at all, and that can be seen to be whole: a seal at the end of a binary one.

The seal is a line with the SHA-256 of all before it. HDF5 and NetCDF 3 say within themselves where they end, so other
programs do not mind it. Our readers look at it first: a damaged file is not given to a library that trusts its bytes.
"""

import contextlib
import hashlib
import os
from pathlib import Path

from .text_file import RecordingError, read_bytes

_SEAL = b"\npzctl recording 1, sha256 of all before this line: "
_LENGTH = len(_SEAL) + 64 + 1


def write_whole(path: Path, content: bytes) -> None:
    """Put the content there in one step: others see the old file or the whole new one. Raises RecordingError."""
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("xb") as file:
            file.write(content)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be written: {error.strerror or error}") from None
    finally:
        with contextlib.suppress(OSError):
            part.unlink()


def sealed(content: bytes) -> bytes:
    """Return the content with its seal."""
    return content + _SEAL + hashlib.sha256(content).hexdigest().encode() + b"\n"


def read_sealed(path: Path) -> bytes:
    """Return the content of a sealed file. Raises RecordingError where it is not what pzctl wrote."""
    data = read_bytes(path)
    content = data[:-_LENGTH]
    if not data[len(content) :].startswith(_SEAL):
        says = "no seal at its end: it is cut off, or another program wrote it, which can write CSV or Touchstone"
        raise RecordingError(f"{path}: {says}")
    if sealed(content) != data:
        raise RecordingError(f"{path}: it is damaged, or was changed since pzctl wrote it: its checksum is another")
    return content
