"""Clients that reset their connections do not end the daemon: libzmq would abort the process at its next heartbeat."""

import json
import os
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import ExitStack, suppress
from pathlib import Path

import pytest
import raw_peer
import zmq
from keyed import unlocked

from pzctl import connect
from pzctl.daemon.client.location import Location

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="this needs Linux")

SERVER = """
import zmq
from pzctl.daemon.server.access.connection_guard import ConnectionGuard, keep_resets_out
from pzctl.daemon.server.sockets import REQUESTS_KEPT
from pzctl.daemon.wire.socket_options import limit
requests = zmq.Context().socket(zmq.ROUTER)
limit(requests)
requests.set(zmq.RCVHWM, REQUESTS_KEPT)
port = requests.bind_to_random_port("tcp://127.0.0.1")
keep_resets_out(port)
print(port, flush=True)
if input() == "cut":
    from collections import Counter
    ConnectionGuard({port: 1}, Counter()).cut(port, "a test")
    print("done", flush=True)
    input()
read = 0
while requests.poll(1500):
    requests.recv_multipart()
    read += 1
print(read, flush=True)
"""
"""A socket like the one for requests, without keys, so that a hand-made peer can connect; it reads when told to."""

REQUEST_AND_PING = b"\0\3abc" + b"\4\7\4PING\0\0"


@pytest.mark.parametrize("who", ["client", "guard"])
def test_a_connection_that_ends_while_requests_wait_ends_nothing_else(
    who: str, start_program: Callable[..., "subprocess.Popen[str]"]
) -> None:
    pipe = subprocess.PIPE
    server = start_program([sys.executable, "-c", SERVER], stdin=pipe, stdout=pipe, stderr=pipe, text=True)
    assert server.stdin is not None
    assert server.stdout is not None
    port = int(server.stdout.readline())
    with raw_peer.greeted(f"tcp://127.0.0.1:{port}", b"DEALER") as link:
        link.sendall(REQUEST_AND_PING * 200)
        time.sleep(0.5)  # libzmq reads ten requests, and the rest of its buffer
        if who == "client":
            link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
            link.close()
        else:
            server.stdin.write("cut\n")
            server.stdin.flush()
            assert server.stdout.readline() == "done\n"
        time.sleep(2.5)  # two heartbeats
        out, error = server.communicate("go on\n", timeout=60)
    assert (server.returncode, out) == (0, "200\n"), error


def test_clients_that_ask_much_and_leave_without_reading(start_daemon: Callable[..., Location]) -> None:
    where = start_daemon()
    requests = [json.dumps({"id": str(k), "request": "status"}).encode() for k in range(100)]
    with zmq.Context() as context, connect() as lab:
        for _ in range(10):
            with ExitStack() as stack:
                deaf = [stack.enter_context(context.socket(zmq.DEALER)) for _ in range(20)]
                for one in deaf:
                    one.linger = 0
                    unlocked(one, where).connect(where.requests)
                for request in requests:
                    for one in deaf:
                        with suppress(zmq.Again):
                            one.send(request, zmq.NOBLOCK)
                time.sleep(0.15)
        os.kill(where.pid, 0)
        assert lab.status().run == where.run
        descriptors = Path(f"/proc/{where.pid}/fd")
        deadline = time.monotonic() + 60
        while len(list(descriptors.iterdir())) > 100:
            assert time.monotonic() < deadline, "connections that were reset end"
            time.sleep(0.1)
