"""Resource strings of instruments, as people type them, and opening sessions with them."""

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
    "GPIB0::17::INSTR, TCPIP0::HOST::5025::SOCKET, HOST:5025, USB0::0x2A8D::0x5F01::SERIAL::INSTR, "
    "PROLOGIX::HOST:1234::17, PROLOGIX::/dev/ttyUSB0::17 or recording:FILE"
)
"""The forms of a resource, for error messages and help."""

OPEN_SECONDS = 5.0
"""Seconds within which a connection has to be made."""

PROLOGIX_PORT = 1234
"""Default port of a Prologix or AR488 adapter."""

VI_ERROR_TMO = "-1073807339"
"""Error text of pyvisa-py (0.8) for a connection that was not made in time."""

_HOST_PORT = re.compile(r"([A-Za-z0-9][A-Za-z0-9_.-]*):(\d{1,5})")
_SOCKET = re.compile(r"TCPIP\d*::([^:,\s]+)::(\d{1,5})::SOCKET", re.IGNORECASE)
_GPIB = re.compile(r"GPIB\d*::(?P<address>\d{1,2})(::\d{1,2})?::INSTR", re.IGNORECASE)
_PROLOGIX = re.compile(
    r"PROLOGIX::(?:(?P<serial>/[\w./-]+|COM\d+)|(?P<host>[A-Za-z0-9][\w.-]*)(?::(?P<port>\d{1,5}))?)::(?P<address>\d{1,2})",
    re.IGNORECASE,
)
_USB = re.compile(r"USB\d*(::(0x[0-9A-F]{1,4}|\d{1,5})){2}::[^:\s]+(::\d+)?::INSTR", re.IGNORECASE)
_NETWORK = re.compile(r"(?:TCPIP|PRLGX-TCPIP)\d*::([^:,\s]+)::(\d{1,5})::(?:SOCKET|INTFC)", re.IGNORECASE)
_NETWORK_HOST = re.compile(r"(?:TCPIP\d*|PROLOGIX)::([A-Z0-9][\w.-]*)", re.IGNORECASE)
_GATEWAY = re.compile(r"TCPIP\d*::[^:,\s]+::gpib\d+,\d{1,2}::INSTR", re.IGNORECASE)


def resource_name(given: str) -> str:
    """Return the VISA resource string for `given`. Raises InstrumentError if it is not a valid resource."""
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
    if _GATEWAY.fullmatch(text) or _USB.fullmatch(text):
        return text
    raise InstrumentError(f"resource {given!r}: not an instrument's address; allowed are {ALLOWED}")


def same_instrument(first: str, second: str) -> bool:
    """Return whether two resources are the address of one instrument, however they are written.

    `HOST:PORT` is short for `TCPIP0::HOST::PORT::SOCKET`; a resource that is no address, such as a recording, is not.
    """
    try:
        return _canonical(first) == _canonical(second)
    except InstrumentError:
        return False


def _canonical(given: str) -> str:
    """Return the only form of an address among those that VISA takes as the same. Raises InstrumentError."""
    from pyvisa.rname import InvalidResourceName, to_canonical_name

    name = resource_name(given)
    try:
        return to_canonical_name(name).upper()
    except InvalidResourceName:  # a Prologix adapter
        return name.upper()


def address_of(name: str) -> str:
    """Return the only form of the address `name`, a result of `resource_name`, with its host as a number."""
    canonical = _canonical(name)
    network = _NETWORK_HOST.match(canonical)
    if network is None:
        return canonical
    try:
        host = socket.gethostbyname(network[1])
    except (OSError, UnicodeError):  # it is refused when the session is opened
        host = network[1]
    return f"{canonical[: network.start(1)]}{host}{canonical[network.end(1) :]}"


def open_session(name: str) -> "Session":
    """Open a VISA session to `name`, a result of `resource_name`. Raises InstrumentError."""
    from .session import Session

    prologix = _PROLOGIX.fullmatch(name)
    if not prologix:
        return Session(_open(name, "@py" if not name.upper().startswith("GPIB") else _gpib_library()))
    by_net = f"PRLGX-TCPIP0::{prologix['host']}::{prologix['port'] or PROLOGIX_PORT}::INTFC"
    bridge = _open(f"PRLGX-ASRL0::{prologix['serial']}::INTFC" if prologix["serial"] else by_net, "@py")
    try:
        # The adapter waits this long for the first byte of an answer; EOI marks the end, so a long wait costs nothing.
        bridge.write_raw(b"++read_tmo_ms 3000\n")
        return Session(_open(f"GPIB0::{prologix['address']}::INSTR", "@py"), bridge)
    except (InstrumentError, OSError) as error:
        bridge.close()
        raise InstrumentError(f"{name}: {' '.join(str(error).split())}") from None


def _open(name: str, library: str) -> "MessageBasedResource":
    from pyvisa import ResourceManager

    _check_host(name)
    # pyvisa shares one manager per library and process; closing it would close every session.
    manager = ResourceManager(library)
    try:
        resource: Any = manager.open_resource(name, open_timeout=round(1000 * OPEN_SECONDS))
    except Exception as error:  # pyvisa-py also raises plain Exception and ValueError
        raise InstrumentError(f"{name}: {_why_not(name, error)}") from None
    try:
        _check_connected(name, resource)
    except InstrumentError:
        resource.close()
        raise
    return resource


def _gpib_library() -> str:
    """Return the VISA library for GPIB: the vendor's if one is installed, otherwise pyvisa-py."""
    from pyvisa import ResourceManager

    with contextlib.suppress(
        Exception
    ):  # without a vendor library: OSError, ValueError or LibraryError, depending on the platform
        ResourceManager("@ivi")
        return "@ivi"
    return "@py"


def _check_host(name: str) -> None:
    """Raise InstrumentError for an unknown host before pyvisa-py does, which would leave a socket open."""
    if network := _NETWORK.fullmatch(name):
        try:
            socket.getaddrinfo(network[1], None, socket.AF_INET)
        except (OSError, UnicodeError):
            raise InstrumentError(f"{name}: host {network[1]} is unknown") from None


def _check_connected(name: str, resource: "MessageBasedResource") -> None:
    """Raise InstrumentError for a refused connection, which pyvisa-py (0.8) only notices with the first byte sent."""
    from .session import underlying_socket

    line = underlying_socket(resource)
    if line is not None and (code := line.getsockopt(socket.SOL_SOCKET, socket.SO_ERROR)):
        raise InstrumentError(f"{name}: {_why_not(name, OSError(code, ''))}")


def _why_not(name: str, error: Exception) -> str:
    """Return the reason why a session could not be opened, as one clause."""
    text = " ".join(str(error).split())
    network = _NETWORK.fullmatch(name)
    if network and isinstance(error, OSError):
        reason = os.strerror(error.errno or 0).lower()
        return f"nothing listens there ({reason}); is the analyzer (or `pzctl sim`) on, and the port {network[2]}?"
    if network and ("timeout" in text.lower() or VI_ERROR_TMO in text):
        return f"no answer within {OPEN_SECONDS:g} s; is {network[1]} switched on and on this network?"
    if name.upper().startswith("GPIB"):
        return f"GPIB cannot be used here: {text}; install NI-VISA or Keysight IO Libraries, or use the LAN port"
    return f"cannot be opened: {text}"
