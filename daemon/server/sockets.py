"""The daemon's two sockets; every client needs a key, on this machine too."""

import ipaddress
import socket
from collections.abc import Sequence
from pathlib import Path
from urllib.parse import urlsplit

import zmq
import zmq.asyncio

from ...models.base.errors import PzctlError
from ..files.config import is_port
from ..wire.curve_keys import KeyFileError
from ..wire.events import WELCOME
from ..wire.frames import LARGEST_FRAME
from ..wire.socket_options import HIGH_WATER, limit
from .access.access_control import DOMAIN, AccessControl
from .access.connection_guard import keep_resets_out

LARGEST_SUBSCRIPTION = 512
"""Greatest size of a subscription in bytes; large enough for CURVE's handshake, which this limits too."""

REQUESTS_KEPT = 10
"""Greatest number of requests of one connection that wait to be read; TCP holds back further ones."""

RECEIVE_BUFFER = 128 << 10
"""Bytes that the kernel buffers for one connection; libzmq's thread reads a whole buffer before the next connection."""

HANDSHAKE = 10_000
"""Milliseconds after which a connection without a complete handshake is closed: idle ones keep others out no longer."""

ANSWERS_KEPT = 50
"""Greatest number of answers to keep for a client that does not read them; one answer may hold 50 sweeps."""


class EndpointError(PzctlError):
    """An address that the daemon cannot, or must not, listen on."""


def is_loopback(endpoint: str) -> bool:
    """Return whether an endpoint can be reached from this machine only."""
    if endpoint.startswith(("inproc://", "ipc://")):
        return True
    host = urlsplit(endpoint).hostname
    if host is None:
        return False
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name, `*` or an interface: all its addresses must be loopback
        try:
            addresses = socket.getaddrinfo(host, None)
        except OSError:
            return False
        return all(ipaddress.ip_address(a[4][0]).is_loopback for a in addresses)


def access_control_for(endpoints: Sequence[str], keys: Path) -> AccessControl:
    """Return the access control for these endpoints.

    Raises EndpointError if an endpoint is not valid, if the keys cannot be used, or if other machines can reach an
    endpoint and there are no keys for them.
    """
    for endpoint in endpoints:
        if not endpoint.startswith(("tcp://", "ipc://", "inproc://")):
            raise EndpointError(f"endpoint {endpoint!r}: tcp://HOST:PORT is needed, with * for any free port")
        port = endpoint.rpartition(":")[2]
        if endpoint.startswith("tcp://") and port != "*" and not is_port(port):  # libzmq takes 99999 for 34463
            raise EndpointError(f"endpoint {endpoint!r}: port {port!r} does not exist; 0 to 65535 or * is allowed")
        if not endpoint.isprintable():
            raise EndpointError(f"endpoint {endpoint!r}: characters that cannot be printed are not allowed")
    outside = [endpoint for endpoint in endpoints if not is_loopback(endpoint)]
    try:
        return AccessControl(keys, outside=bool(outside))
    except KeyFileError as error:
        if not outside:
            raise EndpointError(f"endpoint {endpoints[0]!r}: its keys cannot be used: {error}") from None
        raise EndpointError(
            f"endpoint {outside[0]!r} can be reached from other machines; that needs keys (`pzctl keys server`, then "
            f"`pzctl keys client NAME`): {error}"
        ) from None


def from_here(endpoint: str) -> str:
    """Return the address of a bound endpoint for programs on this machine."""
    return endpoint.replace("//0.0.0.0:", "//127.0.0.1:").replace("//[::]:", "//[::1]:")


def bind_events(
    context: "zmq.Context[zmq.Socket[bytes]]", endpoint: str, access: AccessControl
) -> tuple["zmq.Socket[bytes]", str]:
    """Bind the socket that publishes events; return it and its address. Raises EndpointError."""
    events = context.socket(zmq.PUB)
    events.set(zmq.XPUB_WELCOME_MSG, WELCOME)
    return events, _bind(events, endpoint, access, longest=LARGEST_SUBSCRIPTION)


def bind_requests(context: zmq.asyncio.Context, endpoint: str, access: AccessControl) -> tuple[zmq.asyncio.Socket, str]:
    """Bind the socket that receives requests; return it and its address. Raises EndpointError."""
    requests = context.socket(zmq.ROUTER)
    plain: zmq.Socket[bytes] = zmq.Socket(shadow=requests)
    return requests, _bind(plain, endpoint, access, kept=ANSWERS_KEPT, waiting=REQUESTS_KEPT)


def port_of(endpoint: str) -> int:
    """Return the port of a bound address, or 0 if it has none."""
    return urlsplit(endpoint).port or 0


def _bind(
    any_socket: "zmq.Socket[bytes]",
    endpoint: str,
    access: AccessControl,
    *,
    kept: int = HIGH_WATER,
    waiting: int = HIGH_WATER,
    longest: int = LARGEST_FRAME,
) -> str:
    """Configure and bind a socket; return its address. On failure, close it and raise EndpointError."""
    limit(any_socket)
    any_socket.set(zmq.SNDHWM, kept)
    any_socket.set(zmq.RCVHWM, waiting)
    any_socket.set(zmq.MAXMSGSIZE, longest)
    any_socket.set(zmq.RCVBUF, RECEIVE_BUFFER)
    any_socket.set(zmq.HANDSHAKE_IVL, HANDSHAKE)
    any_socket.set(zmq.CURVE_SERVER, 1)
    any_socket.set(zmq.CURVE_SECRETKEY, access.server.secret.encode())
    any_socket.set(zmq.ZAP_DOMAIN, DOMAIN.encode())
    any_socket.set(zmq.ZAP_ENFORCE_DOMAIN, 1)  # also refuses the unversioned ZMTP that an HTTP request can imitate
    any_socket.set(zmq.LINGER, 500)  # ms, so that a stopping daemon still sends its last messages
    try:
        any_socket.bind(endpoint)
    except zmq.ZMQError as error:
        any_socket.close()
        raise EndpointError(f"endpoint {endpoint!r} cannot be bound: {error.strerror}") from None
    bound = str(any_socket.getsockopt_string(zmq.LAST_ENDPOINT)).rstrip("\0")
    keep_resets_out(port_of(bound))
    return bound
