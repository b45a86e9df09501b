"""An open VISA session, and the socket below it where pyvisa-py made it."""

import select
import socket
from typing import Any, NamedTuple

from pyvisa.constants import ResourceAttribute
from pyvisa.resources import MessageBasedResource


class Session(NamedTuple):
    """An open VISA session to an instrument."""

    instrument: MessageBasedResource
    bridge: MessageBasedResource | None = None
    """The adapter the instrument is reached through, where there is one: it must be open as long as the instrument."""


def prepared(instrument: MessageBasedResource, bridge: MessageBasedResource | None) -> socket.socket | None:
    """Set the session up for whole answers; return the socket below it, None where there is none."""
    (bridge or instrument).read_termination = "\n"
    line = underlying_socket(bridge or instrument)
    if line is not None:
        # What came before a timeout is then handed over instead of being dropped with it.
        (bridge or instrument).set_visa_attribute(ResourceAttribute.suppress_end_enabled, False)
        # Else a message is held back until the peer acknowledges the one before, 40 ms later.
        line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
    return line


def underlying_socket(resource: MessageBasedResource) -> socket.socket | None:
    """Return the socket below a session of pyvisa-py; None where there is none, or another library runs."""
    sessions: dict[Any, Any] = getattr(resource.visalib, "sessions", {})
    interface = getattr(sessions.get(resource.session), "interface", None)
    return interface if isinstance(interface, socket.socket) else None


def hung_up(line: socket.socket | None) -> bool:
    """Tell whether the peer closed the connection. pyvisa-py (0.8) takes that for silence."""
    if line is None:
        return False
    try:
        return bool(select.select([line], [], [], 0)[0]) and line.recv(1, socket.MSG_PEEK) == b""
    except (OSError, ValueError):
        return True
