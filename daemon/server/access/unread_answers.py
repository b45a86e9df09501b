"""Unread answers per connection, so that a client that does not read cannot fill the daemon's memory.

libzmq keeps a number of answers for a connection, however large they are, and does not report what it sent. The kernel
(TCP_INFO) reports how many bytes the other side has acknowledged; only Linux provides this number.
"""

import os
import struct
import sys
import time
from dataclasses import dataclass, field

from . import kernel_sockets

MOST_UNREAD = 64 << 20
"""Most bytes of unread answers to one connection; one answer has at most some 16 MB."""

MOST_UNREAD_BY_ALL = 512 << 20
"""The same of all connections together."""

LITTLE = 64 << 10
"""Size of an answer below which it is not counted: libzmq keeps only a few of them."""

MOST_KNOWN = 1000
"""Number of connections after which those that have ended are forgotten."""

FORGOTTEN = 5.0
"""Seconds without progress, with nothing left to send, after which answers count as dropped by libzmq."""

STALLED = 2.0
"""Seconds without progress after which a client counts as one that reads nothing: less than its heartbeat allows."""

_ESTABLISHED = 1
"""The first byte of the kernel's `struct tcp_info` while both sides have the connection open."""

_BYTES_ACKED = 120
"""Offset of `tcpi_bytes_acked` in the kernel's `struct tcp_info`; it ends before `tcpi_bytes_received`."""

_NOT_SENT = 144
"""Offset of `tcpi_notsent_bytes`."""


@dataclass
class _Reader:
    """One connection: bytes given to it, and bytes it has read."""

    given: int
    read: int
    at: float
    """Time when it last read something, or was given something after it had read all."""
    underway: dict[str, int] = field(default_factory=dict[str, int])
    """The ids of requests whose answers are unread, with the bytes read at the end of each."""


class Connection:
    """A connection at the time when a request came from it; the descriptor may belong to another one later."""

    def __init__(self, handle: int) -> None:
        self._handle = handle
        self._link = kernel_sockets.link(handle)

    @property
    def handle(self) -> int:
        """Its descriptor, or -1 if it has ended."""
        return self._handle if kernel_sockets.link(self._handle) == self._link else -1

    @property
    def is_gone(self) -> bool:
        """Whether it has ended, or its client has closed it; False where the system does not tell."""
        if sys.platform != "linux" or self._handle < 0:
            return False
        info = kernel_sockets.tcp_info(self._handle)
        return kernel_sockets.link(self._handle) != self._link or info is None or info[0] != _ESTABLISHED


class UnreadAnswers:
    """Counts the unacknowledged bytes of answers to each connection; on other systems none."""

    def __init__(self) -> None:
        self._readers: dict[str, _Reader] = {}
        self._handles: set[int] = set()
        """Descriptors of connections that had a large answer; the others are not checked."""

    def answered(self, handle: int, size: int, request: str | None = None) -> None:
        """Record an answer to the connection with this descriptor, to the request with this id."""
        if size < LITTLE or handle < 0:
            return
        self._handles.add(handle)
        if len(self._readers) > MOST_KNOWN:
            self._forget_closed()
        if (reader := self._reader(handle)) is None:
            return
        if reader.given == reader.read:
            reader.at = time.monotonic()
        reader.given += size
        if request is not None:
            reader.underway[request] = reader.given

    def is_reading(self, handle: int) -> bool:
        """Return whether a connection's client has read something lately, however slowly."""
        reader = self._reader(handle) if handle in self._handles else None
        return reader is None or time.monotonic() - reader.at <= STALLED

    def is_underway(self, handle: int, request: str | None) -> bool:
        """Return whether a client that reads has not yet read all of an earlier answer to the request with this id."""
        reader = self._reader(handle) if handle in self._handles else None
        return reader is not None and request in reader.underway and self.is_reading(handle)

    def too_much(self, handle: int) -> int:
        """Return the number of unread bytes if they are too many for a further answer, else 0."""
        reader = self._reader(handle) if handle in self._handles else None
        waiting = 0 if reader is None else reader.given - reader.read
        if waiting > MOST_UNREAD:
            return waiting
        if waiting and sum(other.given - other.read for other in self._readers.values()) > MOST_UNREAD_BY_ALL:
            self._forget_closed()
            everybody = sum(other.given - other.read for other in self._readers.values())
            return everybody if everybody > MOST_UNREAD_BY_ALL else 0
        return 0

    def _reader(self, handle: int) -> _Reader | None:
        """Return the present state of a connection, or None if the kernel has no data about it."""
        link, told = kernel_sockets.link(handle), _told(handle)
        if told is None:
            return None
        acknowledged, unsent = told
        now = time.monotonic()
        reader = self._readers.setdefault(link, _Reader(acknowledged, acknowledged, now))
        if acknowledged != reader.read:
            reader.read, reader.at = acknowledged, now
        elif not unsent and now - reader.at > FORGOTTEN:
            reader.given = acknowledged
        reader.given = max(reader.given, acknowledged)  # heartbeats and frame headers do not count as answers
        reader.underway = {
            request: end for request, end in reader.underway.items() if acknowledged < end <= reader.given
        }
        return reader

    def _forget_closed(self) -> None:
        """Forget connections that have ended, and check the others again."""
        links = {kernel_sockets.link(int(name)): int(name) for name in os.listdir("/proc/self/fd")}  # noqa: PTH208
        self._readers = {link: reader for link, reader in self._readers.items() if link in links}
        for link in [*self._readers]:
            self._reader(links[link])


def _told(handle: int) -> tuple[int, int] | None:
    """Return a connection's acknowledged bytes and those that the kernel has not sent yet, or None."""
    info = kernel_sockets.tcp_info(handle)
    if info is None:
        return None
    try:
        (acknowledged,) = struct.unpack_from("Q", info, _BYTES_ACKED)
        (unsent,) = struct.unpack_from("I", info, _NOT_SENT)
    except struct.error:  # an older kernel tells less
        return None
    return acknowledged, unsent
