"""Atomic writing of files, and a seal at the end of binary files that shows whether they are intact.

The seal is a line with the SHA-256 of everything before it. HDF5 and NetCDF 3 files contain their own length, so other
programs ignore the seal. pzctl checks it before it passes a file to a library that trusts its bytes.
"""

import contextlib
import hashlib
import os
from pathlib import Path

from .text_file import RecordingError, read_bytes

_SEAL = b"\npzctl recording 1, sha256 of all before this line: "
_LENGTH = len(_SEAL) + 64 + 1


def write_whole(path: Path, content: bytes) -> None:
    """Write a file atomically: other programs see the old file or the complete new one. Raises RecordingError."""
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
    """Return the content of a sealed file. Raises RecordingError if the seal is missing or does not match."""
    data = read_bytes(path)
    content = data[:-_LENGTH]
    if not data[len(content) :].startswith(_SEAL):
        says = "no seal at its end: it is cut off, or from another program; use CSV or Touchstone for such data"
        raise RecordingError(f"{path}: {says}")
    if sealed(content) != data:
        raise RecordingError(f"{path}: it is damaged, or was changed since pzctl wrote it: its checksum does not match")
    return content
