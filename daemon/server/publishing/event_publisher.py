"""The events socket, in a thread of its own that waits for events in C code.

libzmq processes the subscriptions to a socket in the thread that uses the socket, for as long as they arrive. In the
daemon's event loop, a client that subscribes without end would delay all answers. The socket is a PUB, which, unlike an
XPUB, does not keep subscriptions as messages that fill the memory; it can send the welcome message too.
"""

import logging
import threading
import time
from collections.abc import Callable, Sequence

import zmq

log = logging.getLogger(__name__)

HIGH_WATER = 1000
"""Greatest number of events that wait for the thread; further ones are dropped, which clients notice by `seq`."""

LINGER = 1.0
"""Seconds for sending the last events."""

PAUSE = 0.1
"""Seconds after an event that could not be sent."""


class EventPublisher:
    """Publishes events on a socket, which it owns from now on."""

    def __init__(self, context: "zmq.Context[zmq.Socket[bytes]]", events: "zmq.Socket[bytes]") -> None:
        self._events = events
        self._sender, self._receiver = context.socket(zmq.PAIR), context.socket(zmq.PAIR)
        for end in (self._sender, self._receiver):
            end.set(zmq.SNDHWM, HIGH_WATER)
            end.set(zmq.RCVHWM, HIGH_WATER)
            end.set(zmq.LINGER, 0)
        self._receiver.bind("inproc://event_publisher")
        self._sender.connect("inproc://event_publisher")
        self._thread = threading.Thread(target=self._speak, name="voice", daemon=True)
        self._thread.start()

    def say(self, frames: Sequence[bytes]) -> None:
        """Publish an event without ever waiting."""
        try:
            self._sender.send_multipart(frames, zmq.NOBLOCK)
        except zmq.Again:  # the thread is a thousand events behind: clients request them again
            return

    def close(self, make_way: Callable[[], None]) -> None:
        """Publish the remaining events and close the sockets; call `make_way` if a client holds up the thread."""
        self.say([b""])
        self._thread.join(LINGER)
        while self._thread.is_alive():
            make_way()
            self.say([b""])
            self._thread.join(0.1)
        for end in (self._sender, self._receiver, self._events):
            end.close()

    def _speak(self) -> None:
        """Send events until the empty message. One that cannot be sent is logged, and clients request it again."""
        poller = zmq.Poller()
        poller.register(self._receiver, zmq.POLLIN)
        poller.register(self._events, zmq.POLLIN)  # a PUB has nothing to read, but polling lets it send the welcome
        while True:
            try:
                poller.poll()
                while self._receiver.poll(0):
                    frames = self._receiver.recv_multipart(copy=False)  # not copied: large ones need memory
                    if not any(map(len, frames)):
                        return
                    self._events.send_multipart(frames, copy=False)
            except (MemoryError, zmq.ZMQError) as error:
                log.error("an event could not be published: %r", error)
                time.sleep(PAUSE)
