"""Who listens to the events socket: cut off where their key no longer counts, or where they subscribe without end.

libzmq asks for a key at the handshake alone, and keeps every subscription it is sent. So each subscription is looked
at as it comes: the connection it came over, and whose it is. To cut a connection is to shut its TCP socket down;
libzmq then lets go of it as it does of any client that goes, and the client may try to come in again.
"""

import logging
import socket
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import zmq
import zmq.asyncio

log = logging.getLogger(__name__)

MOST_SUBSCRIPTIONS = 100
"""Of one connection; libzmq has no limit of its own, and a hundred thousand of them cost a gigabyte."""


@dataclass
class _Listener:
    """One connection: its two ends, whose key it came in with, and how often it subscribed."""

    ends: tuple[Any, Any]
    key: str | None
    subscriptions: int = 0


class Audience:
    """The connections that subscribed; to be read from all the time, or the welcome is never sent."""

    def __init__(self, events: zmq.asyncio.Socket) -> None:
        self._events = events
        self._listeners: dict[int, _Listener] = {}

    async def listen(self) -> None:
        """Read the subscriptions, for ever."""
        while True:
            self._note(await self._events.recv(copy=False))

    def keep(self, allowed: Callable[[str | None], bool]) -> None:
        """Cut off everybody whose key is not allowed."""
        for handle, one in list(self._listeners.items()):
            if not allowed(one.key):
                self._cut(handle, "its key no longer counts")

    def _note(self, frame: zmq.Frame) -> None:
        if frame.bytes[:1] != b"\1":  # taken back; or the connection has gone, and libzmq takes all of it back
            return
        handle = _property(frame, "__fd")
        ends = _ends(int(handle)) if handle else None
        if handle is None or ends is None:
            return
        known = self._listeners.get(int(handle))
        if known is None or known.ends != ends:  # libzmq gives the number of a connection that has gone to the next
            known = self._listeners[int(handle)] = _Listener(ends, _property(frame, "User-Id"))
        known.subscriptions += 1
        if known.subscriptions > MOST_SUBSCRIPTIONS:
            self._cut(int(handle), f"it subscribes to more than {MOST_SUBSCRIPTIONS} topics")

    def _cut(self, handle: int, why: str) -> None:
        """Shut a connection down, unless its number belongs to another one by now."""
        one = self._listeners.pop(handle)
        if _ends(handle) != one.ends:
            return
        log.warning("the listener at %s was cut off: %s", one.ends[1], why)
        link = socket.socket(fileno=handle)
        try:
            link.shutdown(socket.SHUT_RDWR)
        except OSError:
            log.info("it had gone already")
        finally:
            link.detach()  # the socket itself is libzmq's


def _ends(handle: int) -> tuple[Any, Any] | None:
    """Return the addresses of both ends of a connection; None where it is none, or has gone."""
    try:
        link = socket.socket(fileno=handle)
    except OSError:
        return None
    try:
        return link.getsockname(), link.getpeername()
    except OSError:
        return None
    finally:
        link.detach()


def _property(frame: zmq.Frame, name: str) -> str | None:
    """Return what libzmq knows of the connection that a frame came over."""
    try:
        return str(frame.get(name))
    except zmq.ZMQError:
        return None
