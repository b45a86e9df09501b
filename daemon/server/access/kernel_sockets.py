"""What the kernel tells of libzmq's connections, which libzmq itself does not: only Linux does so."""

import os
import socket
import sys


class borrowed:  # noqa: N801
    """One of libzmq's sockets, inspected without closing it. Raises OSError if libzmq has closed it meanwhile."""

    def __init__(self, handle: int) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_STREAM, 0, fileno=handle)

    def __enter__(self) -> socket.socket:
        return self._socket

    def __exit__(self, *_: object) -> None:
        self._socket.detach()


def link(handle: int) -> str:
    """Return socket and inode of a descriptor, which is used again after a connection has ended; empty if closed."""
    try:
        return os.readlink(f"/proc/self/fd/{handle}")  # noqa: PTH115
    except OSError:  # closed meanwhile
        return ""


def tcp_info(handle: int) -> bytes | None:
    """Return the kernel's `struct tcp_info` of a connection, or None if there is none."""
    if sys.platform != "linux":
        return None
    try:
        with borrowed(handle) as connection:
            return connection.getsockopt(socket.IPPROTO_TCP, socket.TCP_INFO, 256)
    except OSError:
        return None
