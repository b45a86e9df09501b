"""Options of every socket of this wire: limits, heartbeats, and a client's key."""

import zmq

from .curve_keys import ClientKey
from .frames import LARGEST_FRAME

HIGH_WATER = 1000
"""Greatest number of messages to keep for a slow reader; it loses further ones, which it notices by `seq`."""


def limit(any_socket: "zmq.Socket[bytes]") -> None:
    """Set limits and heartbeats, and let the socket close without waiting."""
    any_socket.set(zmq.LINGER, 0)
    any_socket.set(zmq.SNDHWM, HIGH_WATER)
    any_socket.set(zmq.RCVHWM, HIGH_WATER)
    any_socket.set(zmq.MAXMSGSIZE, LARGEST_FRAME)
    any_socket.set(zmq.HEARTBEAT_IVL, 1000)
    any_socket.set(zmq.HEARTBEAT_TIMEOUT, 3000)
    any_socket.set(zmq.TCP_KEEPALIVE, 1)


def unlock(any_socket: "zmq.Socket[bytes]", key: ClientKey | None) -> None:
    """Set the keys of a client's socket, if there are any."""
    if key is not None:
        any_socket.set(zmq.CURVE_SERVERKEY, key.server.encode())
        any_socket.set(zmq.CURVE_PUBLICKEY, key.public.encode())
        any_socket.set(zmq.CURVE_SECRETKEY, key.secret.encode())
