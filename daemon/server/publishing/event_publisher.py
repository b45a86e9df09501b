"""The events socket, in a thread of its own that waits in C for what is to be said.

libzmq works through the subscriptions to a socket in the thread that uses it, for as long as they come, and an XPUB
keeps each of them until it is read. In the daemon's loop, somebody who subscribes without end would hold up all
answers, and fill the memory. A PUB notes who wants what and keeps nothing; it can send the welcome as well.
"""

import threading
from collections.abc import Callable, Sequence

import zmq

HIGH_WATER = 1000
"""Events that wait for the thread; what comes then is dropped, and found by `seq`."""

LINGER = 1.0
"""Seconds within which the last words are passed on."""


class EventPublisher:
    """Says events on a socket, which belongs to it from now on."""

    def __init__(self, context: "zmq.Context[zmq.Socket[bytes]]", events: "zmq.Socket[bytes]") -> None:
        self._events = events
        self._said, self._ours = context.socket(zmq.PAIR), context.socket(zmq.PAIR)
        for end in (self._said, self._ours):
            end.set(zmq.SNDHWM, HIGH_WATER)
            end.set(zmq.RCVHWM, HIGH_WATER)
            end.set(zmq.LINGER, 0)
        self._ours.bind("inproc://voice")
        self._said.connect("inproc://voice")
        self._thread = threading.Thread(target=self._speak, name="voice", daemon=True)
        self._thread.start()

    def say(self, frames: Sequence[bytes]) -> None:
        """Publish; nobody is ever waited for."""
        try:
            self._said.send_multipart(frames, zmq.NOBLOCK)
        except zmq.Again:  # it is late by a thousand events: who listens asks for them
            return

    def close(self, make_way: Callable[[], None]) -> None:
        """Say what is still to be said, and close the sockets; `make_way` is called where somebody holds that up."""
        self.say([b""])
        self._thread.join(LINGER)
        while self._thread.is_alive():
            make_way()
            self.say([b""])
            self._thread.join(0.1)
        for one in (self._said, self._ours, self._events):
            one.close()

    def _speak(self) -> None:
        """Pass on until the empty message."""
        poller = zmq.Poller()
        poller.register(self._ours, zmq.POLLIN)
        poller.register(self._events, zmq.POLLIN)  # a PUB has never anything to read; but this lets it welcome
        while True:
            poller.poll()
            while self._ours.poll(0):
                frames = self._ours.recv_multipart()
                if frames == [b""]:
                    return
                self._events.send_multipart(frames)
