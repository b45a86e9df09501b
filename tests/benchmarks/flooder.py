"""Sends hostile messages, with a key, over several connections: python flooder.py ENDPOINT COUNT CONNECTIONS."""

import sys
from pathlib import Path

import zmq

sys.path.insert(0, str(Path(__file__).parents[1] / "support"))

from hostile_messages import mutated
from keyed import unlocked

OBEYED = (b"shutdown", b'"lease"', b'"measure"')
"""An undamaged one would end the daemon, lease the instrument, or measure."""


def flood(endpoint: str, count: int, connections: int) -> None:
    """Send, reading the answers, and end when everything was sent."""
    ready = [frames for frames in map(mutated, range(5000)) if frames[0]]
    ready = [frames for frames in ready if not any(word in frames[0] for word in OBEYED)]
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    links = [context.socket(zmq.DEALER) for _ in range(connections)]
    for link in links:
        unlocked(link).connect(endpoint)
    for k in range(count):
        link = links[k % connections]
        link.send_multipart(ready[k % len(ready)])
        while link.poll(0):
            link.recv_multipart()
    for link in links:
        link.send(b'{"id":"last","request":"status"}')
        while b'"last"' not in link.recv_multipart()[0]:
            pass
        link.close()
    context.term()


if __name__ == "__main__":
    flood(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
