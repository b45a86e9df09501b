"""Packet filters on the daemon's connections: no reset of a client ever reaches libzmq.

While ten requests of a client wait to be read, libzmq stops reading from its connection. If the client resets the
connection meanwhile (it does so when it closes with unread answers), libzmq notes the error; the next heartbeat, its
own or one that the client had sent before, then fails an assertion and aborts the process (libzmq 4.3.5, `!_io_error`).
So the kernel drops resets: what had arrived is read, and a heartbeat without an answer ends the connection after 3 s.
Only Linux has such filters.
"""

import ctypes
import socket
import struct
import sys
from typing import Final, TypeAlias

Instruction: TypeAlias = tuple[int, int, int, int]
"""Of the kernel's packet filter: code, jump if true, jump if false, operand."""

_DROP: Final[Instruction] = (0x06, 0, 0, 0)
_TAKE: Final[Instruction] = (0x06, 0, 0, 0xFFFFFFFF)

NO_RESETS: Final = ((0x30, 0, 0, 13), (0x45, 0, 1, 0x04), _DROP, _TAKE)
"""Load byte 13 of the TCP header, the flags; drop the segment if RST is among them."""

NOTHING: Final = (_DROP,)

_ATTACH = 26
"""SO_ATTACH_FILTER, which Python does not name."""


def attach(connection: socket.socket, program: tuple[Instruction, ...]) -> None:
    """Let the kernel filter what arrives at a socket; accepted connections inherit it. Raises OSError."""
    code = ctypes.create_string_buffer(b"".join(struct.pack("HBBI", *line) for line in program))
    connection.setsockopt(socket.SOL_SOCKET, _ATTACH, struct.pack("HP", len(program), ctypes.addressof(code)))


def end(connection: socket.socket) -> None:
    """Let libzmq close a connection: it reads what has arrived, then the end, and the client gets a reset.

    A reset from here would be one more that reaches libzmq. Raises OSError if the connection is closed already.
    """
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
    attach(connection, NOTHING)
    connection.shutdown(socket.SHUT_RD)


def listens(connection: socket.socket) -> bool:
    """Return whether a socket accepts connections."""
    return sys.platform == "linux" and bool(connection.getsockopt(socket.SOL_SOCKET, socket.SO_ACCEPTCONN))
