"""The clients in the folder `keys/clients`; files that are added, changed or removed take effect at once."""

import logging
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias

from ...wire.curve_keys import AllowedClient, KeyFileError, admitted, client_files, read_client

log = logging.getLogger(__name__)

SETTLED = 2_000_000_000
"""Nanoseconds after which another change gives a file another time stamp, on every file system."""

_Stamp: TypeAlias = tuple[int, ...]


@dataclass(frozen=True)
class _Read:
    """The content of a file when it was read."""

    stamp: _Stamp | None
    """None if the file has to be read again, because it changed so recently that a further change might not show."""
    client: AllowedClient | None
    says: str
    """The reason if there is no client."""


class KeyFolder:
    """The clients, one file each. A file that cannot be used is reported once and does not affect the others."""

    def __init__(self, root: Path, clock: Callable[[], int] = time.time_ns) -> None:
        self._root = root
        self._clock = clock
        self._files: dict[Path, _Read] = {}
        self._fault = ""

    def clients(self) -> dict[str, AllowedClient]:
        """Return the clients by their public keys; as before if the folder cannot be listed at the moment."""
        before, fault = self._files, ""
        try:
            self._files = {path: self._read(path, before.get(path)) for path in client_files(self._root)}
        except OSError as error:  # its share is gone, or this process can open no more files
            fault = f"the clients stay as they are: {error}"
        if fault and fault != self._fault:
            log.warning("%s", fault)
        self._fault = fault
        for path, read in self._files.items():
            if read.says and (path not in before or before[path].says != read.says):
                log.warning("this client has no access: %s", read.says)
        return admitted({path: read.client for path, read in self._files.items() if read.client is not None})

    def _read(self, path: Path, before: _Read | None) -> _Read:
        """Return the content of a file, reading it only if it may have changed."""
        now = self._clock()
        try:
            stat = path.stat()
            stamp = (stat.st_ino, stat.st_mode, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns)
            if before is not None and before.stamp == stamp:
                return before
            settled = now - max(stat.st_mtime_ns, stat.st_ctime_ns) > SETTLED
            valid_stamp = stamp if settled else None
        except OSError:  # a broken link or a folder without permission, which `read_client` reports
            valid_stamp = None
        try:
            return _Read(valid_stamp, read_client(path), "")
        except KeyFileError as error:
            return _Read(valid_stamp, None, str(error))
