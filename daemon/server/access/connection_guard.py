"""Protection against clients that send too much: their connections are cut before memory or descriptors run out.

libzmq keeps the frames of a message until the last one has arrived, and every subscription, and limits neither. The
guard reads from the kernel (TCP_INFO) how many bytes a connection has received, and is told when a complete request was
read from it. It cuts a connection by ending what libzmq receives, upon which libzmq closes it and frees its memory; the
client may connect again. Only Linux provides these numbers; on other systems no connection is cut.
"""

import asyncio
import logging
import os
import socket
import struct
import sys
import time
from collections import Counter
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass

from . import kernel_sockets, packet_filter

log = logging.getLogger(__name__)

LARGEST_MESSAGE = 16 << 20
"""Greatest size of one request in bytes, all frames together."""

MOST_SUBSCRIBED = 16 << 10
"""Greatest size in bytes of one listener's subscriptions."""

LIFE_SIGNS = 1000.0
"""Bytes per second that are not counted: heartbeats, which CURVE makes longer."""

MOST_GROWTH = 32 << 20
"""Bytes by which this process may grow after the last complete message of a connection that has sent more than `LITTLE`
since, if all such connections together have sent more than one message can have: the frames of a message take up to
four times their bytes on the connection. What one such connection sends cannot be told from an answer that is read."""

LITTLE = 64 << 10

MOST_CONNECTIONS = 500
"""Greatest number of connections; newer ones are cut, so that files can still be opened."""

LOOK = 0.02
"""Seconds between two checks."""

GONE = 5000
"""Milliseconds without an acknowledgement of what was sent after which a client is gone, whose reset was not told to
libzmq (`packet_filter`); no heartbeat ends a connection on which data waits to be sent."""

PROBES = 2
"""Greatest number of the kernel's questions in a row for room for more data that a client may leave unanswered."""

_PROBES, _UNACKED, _LAST_ACK, _BYTES_RECEIVED = 3, 24, 56, 128
"""Offsets in the kernel's `struct tcp_info`: unanswered questions for room, unacknowledged segments, milliseconds since
an acknowledgement, received bytes."""


@dataclass
class _Line:
    """One connection, and the bytes it had received when it was last in order."""

    handle: int
    link: str
    """Socket and inode, since the descriptor of a closed connection is used again."""
    port: int
    peer: str
    since: float
    came: int
    at: float
    heard_came: int
    heard_memory: int
    heard_at: float
    looks: int = 0
    """Number of checks in a row at which it had sent too much."""
    is_cut: bool = False
    """Whether it was ended, which libzmq notices once it reads from it again."""


class ConnectionGuard:
    """Guards the connections to some ports; `most` gives the bytes allowed without a complete request, by port."""

    def __init__(self, most: Mapping[int, int], counts: Counter[str]) -> None:
        self._most = most
        self._counts = counts
        self._lines: dict[str, _Line | None] = {}
        self._heard: set[int] = set()
        self._unfinished = 0
        """Bytes of unfinished messages at the last check, of all connections with more than `LITTLE`."""

    def heard(self, handle: int) -> None:
        """Record that a complete message was read from the connection with this descriptor."""
        self._heard.add(handle)

    async def watch(self) -> None:
        """Check the connections until cancelled; on other systems than Linux, log that this is not possible."""
        if sys.platform != "linux":
            log.warning("connections that send without end are not cut: this needs Linux")
            return
        while True:
            self.look(time.monotonic())
            await asyncio.sleep(LOOK)

    def look(self, now: float) -> None:
        """Cut the connections that sent too much at two checks in a row, as a message may be waiting to be read."""
        memory = _memory()
        known, self._lines = self._lines, {}
        unfinished, self._unfinished = self._unfinished, 0
        for handle, link in _sockets():
            line = known[link] if link in known else self._line(handle, link, now, memory)
            self._lines[link] = line
            if line is not None and self._is_too_much(line, now, memory, unfinished):
                line.looks += 1
                if line.looks > 1:
                    self._cut(line, "it sends without end")
            if line is not None and not line.is_cut and _is_gone(handle):
                self._forget(line)
        self._heard.clear()
        ours = [line for line in self._lines.values() if line is not None]
        for line in sorted(ours, key=lambda line: line.since)[MOST_CONNECTIONS:]:
            self._cut(line, f"there are {MOST_CONNECTIONS} connections")

    def cut(self, port: int, why: str) -> None:
        """Cut all connections to a port."""
        if sys.platform != "linux":
            log.warning("connections should be cut, which needs Linux: %s", why)
        for handle, link in _sockets():
            line = self._line(handle, link, time.monotonic(), 0)
            if line is not None and line.port == port:
                self._cut(line, why)

    def _line(self, handle: int, link: str, now: float, memory: int) -> _Line | None:
        """Return the connection of a socket, or None if it is not connected to one of these ports."""
        try:
            with kernel_sockets.borrowed(handle) as borrowed:
                port, peer = borrowed.getsockname()[1], borrowed.getpeername()
        except (OSError, IndexError):  # not connected, or closed since it was listed
            return None
        came = _came(handle)
        return _Line(handle, link, port, str(peer), now, came, now, came, memory, now) if port in self._most else None

    def _is_too_much(self, line: _Line, now: float, memory: int, unfinished: int) -> bool:
        came = _came(line.handle)
        if line.handle in self._heard:
            line.heard_came, line.heard_memory, line.heard_at = came, memory, now
            line.came, line.at, line.looks = came, now, 0
        over = came - line.came - LIFE_SIGNS * (now - line.at)
        if over <= 0:  # an unused allowance is not carried over
            line.came, line.at = came, now
        said = came - line.heard_came - LIFE_SIGNS * (now - line.heard_at)
        if said > LITTLE:
            self._unfinished += int(said)
        swollen = memory - line.heard_memory > MOST_GROWTH and said > LITTLE and unfinished > LARGEST_MESSAGE
        if over > self._most[line.port] or swollen:
            return True
        line.looks = 0
        return False

    def _forget(self, line: _Line) -> None:
        """End the connection of a client that is gone; of what it sent, libzmq gets no more than it has."""
        with suppress(OSError), kernel_sockets.borrowed(line.handle) as borrowed:
            packet_filter.end(borrowed)
            while borrowed.recv(LITTLE, socket.MSG_DONTWAIT):
                pass
        line.is_cut = True

    def _cut(self, line: _Line, why: str) -> None:
        """End a connection, unless its descriptor belongs to another one by now."""
        if line.is_cut or kernel_sockets.link(line.handle) != line.link:
            return
        try:
            with kernel_sockets.borrowed(line.handle) as borrowed:
                packet_filter.end(borrowed)
        except OSError:  # closed already
            return
        line.is_cut = True
        self._counts["cut-off"] += 1
        log.warning("the connection from %s was cut off: %s", line.peer, why)


def keep_resets_out(port: int) -> None:
    """Let no reset of a client reach libzmq on a port that it listens on; on other systems than Linux do nothing."""
    for handle, _ in _sockets():
        try:
            with kernel_sockets.borrowed(handle) as borrowed:
                if packet_filter.listens(borrowed) and borrowed.getsockname()[1] == port:
                    packet_filter.attach(borrowed, packet_filter.NO_RESETS)
        except (OSError, IndexError) as error:  # another socket, or a kernel without filters
            log.debug("socket %d has no packet filter: %s", handle, error)


def _sockets() -> Iterator[tuple[int, str]]:
    """Yield the descriptors of this process that are sockets, each with its socket link."""
    if sys.platform != "linux":
        return
    for handle in map(int, os.listdir("/proc/self/fd")):  # noqa: PTH208 - fifty times a second, a Path is slow
        link = kernel_sockets.link(handle)
        if link.startswith("socket:"):
            yield handle, link


def _came(handle: int) -> int:
    """Return the bytes that a connection has received, or 0 if it is closed."""
    return _told(handle, "Q", _BYTES_RECEIVED)


def _is_gone(handle: int) -> bool:
    """Return whether the other side of a connection no longer acknowledges what it is sent."""
    waits = _told(handle, "I", _UNACKED) > 0 or _told(handle, "B", _PROBES) > PROBES
    return waits and _told(handle, "I", _LAST_ACK) > GONE


def _told(handle: int, form: str, offset: int) -> int:
    """Return a number of the kernel's `struct tcp_info`, or 0 if the connection is closed."""
    info = kernel_sockets.tcp_info(handle)
    try:
        return struct.unpack_from(form, info, offset)[0] if info is not None else 0
    except struct.error:  # an older kernel tells less
        return 0


def _memory() -> int:
    """Return the resident memory of this process in bytes."""
    if sys.platform != "linux":
        return 0
    with open("/proc/self/statm", "rb") as file:  # noqa: PTH123
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE")
