"""An open VISA session, and its socket if pyvisa-py opened it."""

import selectors
import socket
from typing import Any, NamedTuple

from pyvisa.constants import ResourceAttribute
from pyvisa.resources import MessageBasedResource


class Session(NamedTuple):
    """An open VISA session to an instrument."""

    instrument: MessageBasedResource
    bridge: MessageBasedResource | None = None
    """The adapter to the instrument, if any, which has to stay open as long as the instrument."""


def prepared(instrument: MessageBasedResource, bridge: MessageBasedResource | None) -> socket.socket | None:
    """Configure the session for complete answers; return its socket, or None if it has none."""
    (bridge or instrument).read_termination = "\n"
    line = underlying_socket(bridge or instrument)
    if line is not None:
        # Deliver the bytes received before a timeout, which would otherwise be dropped.
        (bridge or instrument).set_visa_attribute(ResourceAttribute.suppress_end_enabled, False)
        # Otherwise a message waits until the peer acknowledges the previous one, for 40 ms.
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return line


def underlying_socket(resource: MessageBasedResource) -> socket.socket | None:
    """Return the socket of a pyvisa-py session, or None if there is none or another library is used."""
    sessions: dict[Any, Any] = getattr(resource.visalib, "sessions", {})
    interface = getattr(sessions.get(resource.session), "interface", None)
    return interface if isinstance(interface, socket.socket) else None


def readable(line: socket.socket, seconds: float) -> bool:
    """Return whether anything can be read within this time: data, or the end of the connection.

    Raises OSError or ValueError if the socket is closed here.
    """
    with selectors.DefaultSelector() as selector:  # select() would refuse file descriptors above 1023
        selector.register(line, selectors.EVENT_READ)
        return bool(selector.select(seconds))


def hung_up(line: socket.socket | None) -> bool:
    """Return whether the peer closed the connection, which pyvisa-py (0.8) takes for silence."""
    if line is None:
        return False
    try:
        return readable(line, 0) and line.recv(1, socket.MSG_PEEK) == b""
    except (OSError, ValueError):
        return True
