"""The files of a folder journal: arrays, each written once, and orphans, which no row names.

Symbolic links are never followed: neither `arrays/` nor a file in it may be one.
"""

import os
import shutil
from collections.abc import Collection, Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO

from ..store import JournalError
from .array_file import ArrayIndex, read_index

ARRAYS = "arrays"
ORPHANS = "orphans"
"""Folder for files that no row names."""

_FICLONE = 0x40049409
"""Linux ioctl to share the blocks of another file until one of the two is written."""


class ArrayFolder:
    """`arrays/` and `orphans/` in a journal's folder. Every method raises JournalError if the disk fails."""

    def __init__(self, folder: Path) -> None:
        self.arrays = folder / ARRAYS
        self.orphans = folder / ORPHANS
        self._folder = folder

    def make(self) -> None:
        """Make the folder of arrays. Raises JournalError if it, or the folder of orphans, is a symbolic link."""
        for folder in (self.arrays, self.orphans):
            if folder.is_symlink():
                raise JournalError(
                    f"{folder}: this is a symbolic link, which a journal does not follow; put a folder in its place"
                )
        with self._disk_errors():
            self.arrays.mkdir(parents=True, exist_ok=True, mode=0o700)

    def write(self, event: str, data: bytes) -> None:
        """Write an array atomically and sync it."""
        path = self.path(event)
        part = path.with_suffix(".part")
        with self._disk_errors():
            try:
                with part.open("xb") as file:
                    file.write(data)
                    file.flush()
                    os.fsync(file.fileno())
                part.replace(path)
            except OSError:  # what there was room for would take it from the next attempt
                part.unlink(missing_ok=True)
                raise
            sync_folder(self.arrays)

    def read(self, event: str) -> bytes | None:
        """Return the content of an array's file, or None if there is none."""
        path = self.path(event)
        if path.is_symlink():
            raise JournalError(f"{path}: this is a symbolic link, which a journal does not follow")
        try:
            return path.read_bytes() if path.exists() else None
        except OSError as error:
            raise JournalError(f"{path}: the journal cannot be read or written: {error}") from error

    def copy(self, event: str, source: "ArrayFolder") -> None:
        """Copy an array from another folder."""
        path = source.path(event)
        if path.is_symlink():
            raise JournalError(f"{path}: this is a symbolic link, which a journal does not follow")
        with self._disk_errors():
            copy_file(path, self.path(event))
            sync_folder(self.arrays)

    def drop(self, events: Sequence[str]) -> None:
        """Remove the arrays of events that were copied elsewhere and pruned."""
        with self._disk_errors():
            for event in events:
                self.path(event).unlink(missing_ok=True)

    def files(self) -> list[Path]:
        """Return the complete array files of this folder, sorted by name."""
        if self.arrays.is_symlink() or not self.arrays.is_dir():
            return []
        with self._disk_errors():
            return sorted(p for p in self.arrays.iterdir() if p.suffix == ".bin" and p.is_file() and not p.is_symlink())

    def strangers(self, known: Collection[str]) -> list[Path]:
        """Return the array files, complete or partly written, that belong to none of the known events."""
        with self._disk_errors():
            return sorted(
                path
                for path in self.arrays.iterdir()
                if path.suffix == ".part" or (path.suffix == ".bin" and path.stem not in known)
            )

    def index_of(self, path: Path) -> ArrayIndex | None:
        """Return the index of an array's file, or None if it has none or is not a regular file."""
        if path.is_symlink() or not path.is_file():
            return None
        with self._disk_errors():
            return read_index(path)

    def set_aside(self, paths: Sequence[Path]) -> None:
        """Move files to the orphans without overwriting others."""
        if self.orphans.is_symlink():
            raise JournalError(f"{self.orphans}: this is a symbolic link, which a journal does not follow")
        with self._disk_errors():
            self.orphans.mkdir(exist_ok=True, mode=0o700)
            for path in paths:
                path.rename(free_name(self.orphans / path.name))
            sync_folder(self.orphans)
            sync_folder(self.arrays)

    def path(self, event: str) -> Path:
        """Return the path of an event's array."""
        return self.arrays / f"{event}.bin"

    @contextmanager
    def _disk_errors(self) -> Generator[None]:
        try:
            yield
        except OSError as error:
            raise JournalError(f"{self._folder}: the journal cannot be read or written: {error}") from error


def free_name(path: Path) -> Path:
    """Return the path, with a number appended if the name is taken."""
    number = 1
    free = path
    while os.path.lexists(free):
        number += 1
        free = path.with_name(f"{path.name}.{number}")
    return free


def sync_folder(folder: Path) -> None:
    """Sync a folder, so that a rename in it is permanent; not possible and not needed on Windows."""
    if os.name == "posix":
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def copy_file(source: Path, target: Path) -> None:
    """Copy a file to a new one, synced and dropped from the cache, so that it is next read from disk. Raises OSError.

    If the file system supports it, both files share blocks until one is written.
    """
    with source.open("rb") as original, target.open("xb") as copy:
        if not _cloned(original, copy):
            shutil.copyfileobj(original, copy)
        copy.flush()
        os.fsync(copy.fileno())
        if hasattr(os, "posix_fadvise"):
            os.posix_fadvise(copy.fileno(), 0, 0, os.POSIX_FADV_DONTNEED)


def _cloned(original: BinaryIO, copy: BinaryIO) -> bool:
    try:
        import fcntl

        fcntl.ioctl(copy.fileno(), _FICLONE, original.fileno())
    except (ImportError, OSError):
        return False
    return True
