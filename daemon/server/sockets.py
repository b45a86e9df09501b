"""The daemon's two sockets, and who may reach them: only those with a key, from this machine too."""

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

LARGEST_SUBSCRIPTION = 512
"""Bytes; long enough for CURVE's handshake, which counts as well."""

REQUESTS_KEPT = 10
"""Requests of one connection that wait to be read; its TCP connection holds back what comes then."""

RECEIVE_BUFFER = 128 << 10
"""Bytes of one connection that the kernel holds: one thread of libzmq's reads all of them, and the next one waits."""

ANSWERS_KEPT = 50
"""Answers kept for who asks and does not read; one of them may carry 50 sweeps."""


class EndpointError(PzctlError):
    """An address the daemon cannot, or must not, be reached at."""


def is_loopback(endpoint: str) -> bool:
    """Return whether an endpoint can be reached from this machine only."""
    if endpoint.startswith(("inproc://", "ipc://")):
        return True
    host = urlsplit(endpoint).hostname
    if host is None:
        return False
    try:
        return ipaddress.ip_address(host).is_loopback
    except ValueError:  # a name, `*`, an interface: all that it means must be loopback
        try:
            found = socket.getaddrinfo(host, None)
        except OSError:
            return False
        return all(ipaddress.ip_address(a[4][0]).is_loopback for a in found)


def gate_for(endpoints: Sequence[str], keys: Path) -> AccessControl:
    """Return what guards these endpoints.

    Raises EndpointError for what is no endpoint, where the keys cannot be used, and where other machines can reach an
    endpoint and there are no keys for them.
    """
    for endpoint in endpoints:
        if not endpoint.startswith(("tcp://", "ipc://", "inproc://")):
            raise EndpointError(f"endpoint {endpoint!r}: tcp://HOST:PORT is needed, with * for a port that is free")
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
            raise EndpointError(f"endpoint {endpoints[0]!r} cannot be guarded: {error}") from None
        raise EndpointError(
            f"endpoint {outside[0]!r} can be reached from other machines; that needs keys (`pzctl keys server`, then "
            f"`pzctl keys client NAME`): {error}"
        ) from None


def from_here(endpoint: str) -> str:
    """Return a bound address as it is reached from this machine."""
    return endpoint.replace("//0.0.0.0:", "//127.0.0.1:").replace("//[::]:", "//[::1]:")


def bind_events(
    context: "zmq.Context[zmq.Socket[bytes]]", endpoint: str, gate: AccessControl
) -> tuple["zmq.Socket[bytes]", str]:
    """Bind the socket that publishes; return it and the address it got. Raises EndpointError."""
    events = context.socket(zmq.PUB)
    events.set(zmq.XPUB_WELCOME_MSG, WELCOME)
    return events, _bind(events, endpoint, gate, longest=LARGEST_SUBSCRIPTION)


def bind_requests(context: zmq.asyncio.Context, endpoint: str, gate: AccessControl) -> tuple[zmq.asyncio.Socket, str]:
    """Bind the socket that is asked; return it and the address it got. Raises EndpointError."""
    requests = context.socket(zmq.ROUTER)
    plain: zmq.Socket[bytes] = zmq.Socket(shadow=requests)
    return requests, _bind(plain, endpoint, gate, kept=ANSWERS_KEPT, waiting=REQUESTS_KEPT)


def port_of(endpoint: str) -> int:
    """Return the port of a bound address; 0 where it has none."""
    return urlsplit(endpoint).port or 0


def _bind(
    any_socket: "zmq.Socket[bytes]",
    endpoint: str,
    gate: AccessControl,
    *,
    kept: int = HIGH_WATER,
    waiting: int = HIGH_WATER,
    longest: int = LARGEST_FRAME,
) -> str:
    """Bind, or close the socket and say why not."""
    limit(any_socket)
    any_socket.set(zmq.SNDHWM, kept)
    any_socket.set(zmq.RCVHWM, waiting)
    any_socket.set(zmq.MAXMSGSIZE, longest)
    any_socket.set(zmq.RCVBUF, RECEIVE_BUFFER)
    any_socket.set(zmq.CURVE_SERVER, 1)
    any_socket.set(zmq.CURVE_SECRETKEY, gate.server.secret.encode())
    any_socket.set(zmq.ZAP_DOMAIN, DOMAIN.encode())
    any_socket.set(zmq.ZAP_ENFORCE_DOMAIN, 1)  # also turns away the unversioned ZMTP that an HTTP request can imitate
    any_socket.set(zmq.LINGER, 500)  # the last words of a daemon that ends are still sent
    try:
        any_socket.bind(endpoint)
    except zmq.ZMQError as error:
        any_socket.close()
        raise EndpointError(f"endpoint {endpoint!r} cannot be bound: {error.strerror}") from None
    return str(any_socket.getsockopt_string(zmq.LAST_ENDPOINT)).rstrip("\0")
