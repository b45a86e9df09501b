"""From what a person types to an instrument: resource strings, and the way to open them."""

import contextlib
import os
import re
import socket
from typing import TYPE_CHECKING, Any

from ..base.analyzer import InstrumentError

if TYPE_CHECKING:
    from pyvisa.resources import MessageBasedResource

    from .session import Session

ALLOWED = (
    "GPIB0::17::INSTR, TCPIP0::HOST::5025::SOCKET, HOST:5025, PROLOGIX::HOST:1234::17, PROLOGIX::/dev/ttyUSB0::17 "
    "or recording:FILE"
)
"""The forms of a resource, for error messages and help."""

OPEN_SECONDS = 5.0
"""How long a connection may take to be made."""

PROLOGIX_PORT = 1234
"""Where a Prologix or AR488 adapter listens unless told otherwise."""

VI_ERROR_TMO = "-1073807339"
"""How pyvisa-py (0.8) words a connection that was not made in time."""

_HOST_PORT = re.compile(r"([A-Za-z0-9][A-Za-z0-9_.-]*):(\d{1,5})")
_SOCKET = re.compile(r"TCPIP\d*::([^:,\s]+)::(\d{1,5})::SOCKET", re.IGNORECASE)
_GPIB = re.compile(r"GPIB\d*::(?P<address>\d{1,2})(::\d{1,2})?::INSTR", re.IGNORECASE)
_PROLOGIX = re.compile(
    r"PROLOGIX::(?:(?P<serial>/[\w./-]+|COM\d+)|(?P<host>[A-Za-z0-9][\w.-]*)(?::(?P<port>\d{1,5}))?)::(?P<address>\d{1,2})",
    re.IGNORECASE,
)
_NETWORK = re.compile(r"(?:TCPIP|PRLGX-TCPIP)\d*::([^:,\s]+)::(\d{1,5})::(?:SOCKET|INTFC)", re.IGNORECASE)
_GATEWAY = re.compile(r"TCPIP\d*::[^:,\s]+::gpib\d+,\d{1,2}::INSTR", re.IGNORECASE)


def resource_name(given: str) -> str:
    """Return the VISA resource string that `given` stands for. Raises InstrumentError where it is none."""
    text = given.strip()
    if plain := _HOST_PORT.fullmatch(text):
        text = f"TCPIP0::{plain[1]}::{plain[2]}::SOCKET"
    if line := _SOCKET.fullmatch(text):
        if not 0 < int(line[2]) < 65536:
            raise InstrumentError(f"resource {given!r}: port {line[2]} does not exist; 1 to 65535 is allowed")
        return text
    if bus := _GPIB.fullmatch(text) or _PROLOGIX.fullmatch(text):
        if int(bus["address"]) > 30:
            raise InstrumentError(
                f"resource {given!r}: GPIB address {bus['address']} does not exist; 0 to 30 is allowed"
            )
        return text
    if _GATEWAY.fullmatch(text):
        return text
    raise InstrumentError(f"resource {given!r}: not an instrument's address; allowed are {ALLOWED}")


def open_session(name: str) -> "Session":
    """Return an open VISA session to `name`, a result of `resource_name`. Raises InstrumentError."""
    from .session import Session

    found = _PROLOGIX.fullmatch(name)
    if not found:
        return Session(_open(name, "@py" if not name.upper().startswith("GPIB") else _gpib_library()))
    by_net = f"PRLGX-TCPIP0::{found['host']}::{found['port'] or PROLOGIX_PORT}::INTFC"
    bridge = _open(f"PRLGX-ASRL0::{found['serial']}::INTFC" if found["serial"] else by_net, "@py")
    try:
        # It gives up on an answer that has not begun by then; its end is seen by EOI, so patience costs nothing.
        bridge.write_raw(b"++read_tmo_ms 3000\n")
        return Session(_open(f"GPIB0::{found['address']}::INSTR", "@py"), bridge)
    except (InstrumentError, OSError) as error:
        bridge.close()
        raise InstrumentError(f"{name}: {' '.join(str(error).split())}") from None


def _open(name: str, library: str) -> "MessageBasedResource":
    from pyvisa import ResourceManager

    _check_host(name)
    # One manager per library and process, shared by pyvisa itself; closing it would close every session.
    manager = ResourceManager(library)
    try:
        resource: Any = manager.open_resource(name, open_timeout=round(1000 * OPEN_SECONDS))
    except Exception as error:  # pyvisa-py raises bare Exception and ValueError besides VisaIOError
        raise InstrumentError(f"{name}: {_why_not(name, error)}") from None
    try:
        _check_connected(name, resource)
    except InstrumentError:
        resource.close()
        raise
    return resource


def _gpib_library() -> str:
    """Return the VISA library for GPIB: the vendor's where one is installed, pyvisa-py otherwise."""
    from pyvisa import ResourceManager

    with contextlib.suppress(Exception):  # no vendor library: OSError, ValueError or LibraryError by platform
        ResourceManager("@ivi")
        return "@ivi"
    return "@py"


def _check_host(name: str) -> None:
    """Find an unknown host before pyvisa-py does: it would leave a socket behind."""
    if found := _NETWORK.fullmatch(name):
        try:
            socket.getaddrinfo(found[1], None, socket.AF_INET)
        except (OSError, UnicodeError):
            raise InstrumentError(f"{name}: there is no host called {found[1]}") from None


def _check_connected(name: str, resource: "MessageBasedResource") -> None:
    """Find a refused connection: pyvisa-py (0.8) takes it for a connected one until the first byte is sent."""
    from .session import underlying_socket

    line = underlying_socket(resource)
    if line is not None and (code := line.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)):
        raise InstrumentError(f"{name}: {_why_not(name, OSError(code, ''))}")


def _why_not(name: str, error: Exception) -> str:
    """Return the reason, as one clause, why a session could not be opened."""
    text = " ".join(str(error).split())
    found = _NETWORK.fullmatch(name)
    if found and isinstance(error, OSError):
        reason = os.strerror(error.errno or 0).lower()
        return f"nothing listens there ({reason}); is the analyzer (or `pzctl sim`) on, and the port {found[2]}?"
    if found and ("timeout" in text.lower() or VI_ERROR_TMO in text):
        return f"nobody answered within {OPEN_SECONDS:g} s; is {found[1]} on and on this network?"
    if name.upper().startswith("GPIB"):
        return f"GPIB cannot be used here: {text}; install NI-VISA or Keysight IO Libraries, or use the LAN port"
    return f"cannot be opened: {text}"
