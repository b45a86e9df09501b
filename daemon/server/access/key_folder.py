"""The clients in the folder `keys/clients`, as the files are now: what is made, changed or removed counts at once."""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from ...wire.curve_keys import AllowedClient, KeyFileError, client_files, read_client

log = logging.getLogger(__name__)

SETTLED = 2_000_000_000
"""Nanoseconds after which a file that changes again has another time, on every file system."""

_Stamp: TypeAlias = tuple[int, ...]


@dataclass(frozen=True)
class _Read:
    """What a file held when it was read."""

    stamp: _Stamp | None
    """None where it has to be read again: it changed just before, and might since without another time."""
    client: AllowedClient | None
    says: str
    """Why there is no client."""


class KeyFolder:
    """The clients, each of a file of its own: one that cannot be used bars nobody else, and is said once."""

    def __init__(self, root: Path, clock: Callable[[], int] = time.time_ns) -> None:
        self._root = root
        self._clock = clock
        self._files: dict[Path, _Read] = {}

    def clients(self) -> dict[str, AllowedClient]:
        """Return the clients by their public keys."""
        before = self._files
        self._files = {path: self._read(path, before.get(path)) for path in client_files(self._root)}
        for path, read in self._files.items():
            if read.says and (path not in before or before[path].says != read.says):
                log.warning("this client is not let in: %s", read.says)
        return {read.client.public: read.client for read in self._files.values() if read.client is not None}

    def _read(self, path: Path, before: _Read | None) -> _Read:
        """Return what a file holds; it is read only where it may have changed."""
        now = self._clock()
        try:
            stat = path.stat()
            stamp = (stat.st_ino, stat.st_mode, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)
            if before is not None and before.stamp == stamp:
                return before
            settled = now - max(stat.st_mtime_ns, stat.st_ctime_ns) > SETTLED
            kept = stamp if settled else None
        except OSError:  # a link that leads nowhere, a folder that may not be entered: `read_client` says so
            kept = None
        try:
            return _Read(kept, read_client(path), "")
        except KeyFileError as error:
            return _Read(kept, None, str(error))
