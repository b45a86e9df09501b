"""What every socket of this wire sets: limits, life signs, and a client's key."""

import zmq

from .curve_keys import ClientKey
from .frames import LARGEST_FRAME

HIGH_WATER = 1000
"""Messages kept for a slow reader; what comes then is dropped for that reader, who finds the hole by `seq`."""


def limit(any_socket: "zmq.Socket[bytes]") -> None:
    """Set limits, life signs, and no waiting at the end."""
    any_socket.set(zmq.LINGER, 0)
    any_socket.set(zmq.SNDHWM, HIGH_WATER)
    any_socket.set(zmq.RCVHWM, HIGH_WATER)
    any_socket.set(zmq.MAXMSGSIZE, LARGEST_FRAME)
    any_socket.set(zmq.HEARTBEAT_IVL, 1000)
    any_socket.set(zmq.HEARTBEAT_TIMEOUT, 3000)
    any_socket.set(zmq.TCP_KEEPALIVE, 1)


def unlock(any_socket: "zmq.Socket[bytes]", key: ClientKey | None) -> None:
    """Set the key that lets a client's socket in, where the daemon asks for one."""
    if key is not None:
        any_socket.set(zmq.CURVE_SERVERKEY, key.server.encode())
        any_socket.set(zmq.CURVE_PUBLICKEY, key.public.encode())
        any_socket.set(zmq.CURVE_SECRETKEY, key.secret.encode())
