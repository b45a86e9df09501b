"""Who sends the daemon more than it can want is cut off, before memory or descriptors run out.

libzmq keeps the frames of a message until the last one has come, and every subscription, and has no limit for either.
How much has come over a connection is asked of the kernel (TCP_INFO); that a whole request was read of it is told
here. To cut a connection is to reset it: libzmq then lets go of it as it does of any client that goes, and gives
back what it kept. The client may come again. Only Linux says as much; elsewhere nobody is cut off.
"""

import asyncio
import ctypes
import logging
import os
import socket
import struct
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

log = logging.getLogger(__name__)

LARGEST_MESSAGE = 16 << 20
"""Bytes of one request, all frames together."""

MOST_SUBSCRIBED = 16 << 10
"""Bytes of what one listener subscribes to."""

LIFE_SIGNS = 1000.0
"""Bytes a second that count for nothing: heartbeats, which under CURVE are longer."""

MOST_GROWTH = 32 << 20
"""Bytes by which this process may have grown since a connection said something whole, if a little came over it: empty
frames cost thirty times what they weigh on the way."""

LITTLE = 64 << 10

MOST_CONNECTIONS = 500
"""Those that come then are cut off, so that files can still be opened."""

LOOK = 0.02
"""Seconds between two looks."""

_BYTES_RECEIVED = 128
"""Where `tcpi_bytes_received` stands in the kernel's `struct tcp_info`."""


@dataclass
class _Line:
    """One connection, and what had come over it when it was last in order."""

    handle: int
    link: str
    """Socket and inode: libzmq gives the number of one that has gone to the next."""
    port: int
    peer: str
    since: float
    came: int
    at: float
    heard_came: int
    heard_memory: int
    looks: int = 0
    """How often in a row it was found to send too much."""


class ConnectionGuard:
    """The connections to some ports of this process: each with the bytes that may come over it without a request."""

    def __init__(self, most: Mapping[int, int], counts: Counter[str]) -> None:
        self._most = most
        self._counts = counts
        self._lines: dict[str, _Line | None] = {}
        self._heard: set[int] = set()

    def heard(self, handle: int) -> None:
        """Note that a whole message was read of the connection with this descriptor."""
        self._heard.add(handle)

    async def watch(self) -> None:
        """Look, for ever; where there is nothing to be seen, say so once."""
        if sys.platform != "linux":
            log.warning("who sends without end is not cut off here: only Linux tells what comes over a connection")
            return
        while True:
            self.look(time.monotonic())
            await asyncio.sleep(LOOK)

    def look(self, now: float) -> None:
        """Cut off who has sent too much, at two looks in a row: a message may just be waiting to be read."""
        memory = _memory()
        known, self._lines = self._lines, {}
        for handle, link in _sockets():
            line = known[link] if link in known else self._line(handle, link, now, memory)
            self._lines[link] = line
            if line is not None and self._is_too_much(line, now, memory):
                line.looks += 1
                if line.looks > 1:
                    self._cut(line, "it sends without end")
        self._heard.clear()
        ours = [line for line in self._lines.values() if line is not None]
        for line in sorted(ours, key=lambda line: line.since)[MOST_CONNECTIONS:]:
            self._cut(line, f"there are {MOST_CONNECTIONS} connections")

    def cut(self, port: int, why: str) -> None:
        """Cut off everybody at a port."""
        if sys.platform != "linux":
            log.warning("nobody can be cut off here, on Linux alone; a reason to: %s", why)
        for handle, link in _sockets():
            line = self._line(handle, link, time.monotonic(), 0)
            if line is not None and line.port == port:
                self._cut(line, why)

    def _line(self, handle: int, link: str, now: float, memory: int) -> _Line | None:
        """Return a connection; None where it is none to these ports."""
        try:
            with _borrowed(handle) as one:
                port, peer = one.getsockname()[1], one.getpeername()
        except (OSError, IndexError):  # no connection, or one that has gone since it was listed
            return None
        came = _came(handle)
        return _Line(handle, link, port, str(peer), now, came, now, came, memory) if port in self._most else None

    def _is_too_much(self, line: _Line, now: float, memory: int) -> bool:
        came = _came(line.handle)
        if line.handle in self._heard:
            line.heard_came, line.heard_memory = came, memory
            line.came, line.at, line.looks = came, now, 0
        over = came - line.came - LIFE_SIGNS * (now - line.at)
        if over <= 0:  # what was not used up does not add up
            line.came, line.at = came, now
        swollen = memory - line.heard_memory > MOST_GROWTH and came - line.heard_came > LITTLE
        if over > self._most[line.port] or swollen:
            return True
        line.looks = 0
        return False

    def _cut(self, line: _Line, why: str) -> None:
        """Reset a connection, unless its number belongs to another one by now.

        Shut down it would go on to take what comes: Linux resets a TCP socket that is connected to no address.
        """
        if _link(line.handle) != line.link:
            return
        if ctypes.CDLL(None).connect(line.handle, bytes(16), 16):  # AF_UNSPEC is 0
            return  # it had gone already
        self._counts["cut-off"] += 1
        log.warning("the connection from %s was cut off: %s", line.peer, why)


class _borrowed:  # noqa: N801
    """A socket of libzmq's, looked at and left alone. Raises OSError where it has gone: libzmq closes when it likes."""

    def __init__(self, handle: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM, 0, fileno=handle)

    def __enter__(self) -> socket.socket:
        return self._socket

    def __exit__(self, *_: object) -> None:
        self._socket.detach()


def _sockets() -> Iterator[tuple[int, str]]:
    """Yield the descriptors of this process that are sockets, and what each one is."""
    if sys.platform != "linux":
        return
    for handle in map(int, os.listdir("/proc/self/fd")):  # noqa: PTH208 - fifty times a second, a Path is slow
        link = _link(handle)
        if link.startswith("socket:"):
            yield handle, link


def _link(handle: int) -> str:
    try:
        return os.readlink(f"/proc/self/fd/{handle}")  # noqa: PTH115
    except OSError:  # it has gone meanwhile
        return ""


def _came(handle: int) -> int:
    """Return the bytes that have come over a connection; 0 where it has gone."""
    try:
        with _borrowed(handle) as one:
            info = one.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 256)
            return struct.unpack_from("Q", info, _BYTES_RECEIVED)[0]
    except (OSError, struct.error):
        return 0


def _memory() -> int:
    """Return the bytes of memory that this process has in use."""
    if sys.platform != "linux":
        return 0
    with open("/proc/self/statm", "rb") as file:  # noqa: PTH123
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
