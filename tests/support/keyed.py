"""Plain ZeroMQ sockets with a key, as in a program that does not use our client."""

import json
from typing import Any

import zmq

from pzctl.daemon.client.location import Location, find
from pzctl.daemon.files.paths import home, keys_folder
from pzctl.daemon.wire.curve_keys import ClientKey, local_keys
from pzctl.daemon.wire.socket_options import unlock


def unlocked(link: "zmq.Socket[bytes]", where: Location | None = None) -> "zmq.Socket[bytes]":
    """Return the socket with the key of the daemon at `where`; by default, of the one on this test's data folder."""
    there = where or find(home())
    assert there is not None
    unlock(link, there.key)
    return link


def served(link: "zmq.Socket[bytes]") -> "zmq.Socket[bytes]":
    """Return a socket that impersonates the daemon's: it has its key pair."""
    pair = local_keys(keys_folder(home())).server
    link.set(zmq.CURVE_SERVER, 1)
    link.set(zmq.CURVE_SECRETKEY, pair.secret.encode())
    return link


def asked(where: Location, key: ClientKey, request: dict[str, object]) -> dict[str, Any]:
    """Return the header of the answer to one request."""
    with zmq.Context() as context, context.socket(zmq.REQ) as link:
        link.linger = 0
        unlock(link, key)
        link.connect(where.requests)
        link.send(json.dumps({"v": 1, **request}).encode())
        assert link.poll(30_000)
        return json.loads(link.recv_multipart()[0])
