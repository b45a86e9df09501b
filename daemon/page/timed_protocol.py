"""HTTP connections, limited in number, with time limits for sending the request and for reading the answer."""

import asyncio
import ssl
from collections import Counter
from typing import Any, cast

from uvicorn.protocols.http.h11_impl import H11Protocol

HEADER_SECONDS = 10.0
"""Seconds within which the head of a request has to arrive, on a new or reused connection."""

READ_SECONDS = 30.0
"""Seconds for which a client may read nothing while the buffers are full."""


class TimedProtocol(H11Protocol):
    """Uvicorn's HTTP/1.1 protocol with time limits; `request_body` limits the time for the body.

    There are always fewer connections than `limit_concurrency`: a further one takes the place of one that waits for a
    request. So connections that ask nothing close the page to nobody. TLS begins only after that, because a server that
    does it by itself does not tell the protocol of connections before their handshake.
    """

    tls: ssl.SSLContext | None = None
    """For HTTPS; None: HTTP."""
    _handshake: "asyncio.Task[None] | None" = None
    _early: bytes = b""
    """What arrived with the end of the handshake."""
    _head: asyncio.TimerHandle | None = None
    _unread: asyncio.TimerHandle | None = None
    waiting_since: float = 0.0
    """When the last answer ended or the connection began, by the loop's clock."""

    @property
    def address(self) -> str:
        """The address at the other end, without port."""
        return self.client[0] if self.client else ""

    @property
    def waits(self) -> bool:
        """Whether there is no request that is not answered yet."""
        return self.cycle is None or self.cycle.response_complete  # pyright: ignore[reportUnnecessaryComparison]

    def cut_off(self) -> None:
        """End the connection at once."""
        self.connections.discard(self)
        self._head = _stopped(self._head)
        self.transport.abort()

    def connection_made(self, transport: Any) -> None:
        """Start the timer for the first request, and make room if there are too many connections."""
        super().connection_made(transport)
        self.waiting_since = self.loop.time()
        self._wait_for_head()
        if self.limit_concurrency is not None and len(self.connections) >= self.limit_concurrency:
            self._least_needed().cut_off()
        if self.tls is not None and not transport.is_closing():
            transport.pause_reading()  # what arrives now is for the handshake
            self._handshake = self.loop.create_task(self._encrypt(transport, self.tls))

    async def _encrypt(self, plain: Any, context: ssl.SSLContext) -> None:
        """Go on with the encrypted connection once the handshake is done, or end it."""
        try:
            encrypted = await self.loop.start_tls(plain, self, context, server_side=True)
        except OSError:  # SSLError is one
            encrypted = None
        self._handshake = None
        if encrypted is None or plain.is_closing():
            self.connection_lost(None)
            return
        super().connection_made(encrypted)
        if self._early:
            early, self._early = self._early, b""
            self.data_received(early)

    def on_response_complete(self) -> None:
        """Handle the end of an answer; the connection waits for a further request."""
        self.waiting_since = self.loop.time()
        super().on_response_complete()

    def data_received(self, data: bytes) -> None:
        """Handle received data; stop the timer once the head of a request is complete."""
        if self._handshake is not None:
            self._early += data
            return
        super().data_received(data)
        if self.waits:
            self._wait_for_head()
        else:
            self._head = _stopped(self._head)

    def pause_writing(self) -> None:
        """Start the timer for a client that does not read."""
        super().pause_writing()
        self._unread = self._unread or self.loop.call_later(READ_SECONDS, self.transport.abort)

    def resume_writing(self) -> None:
        """Stop the timer, since the client reads again."""
        super().resume_writing()
        self._unread = _stopped(self._unread)

    def connection_lost(self, exc: Exception | None) -> None:
        """Stop all timers."""
        self._head, self._unread = _stopped(self._head), _stopped(self._unread)
        super().connection_lost(exc)

    def _least_needed(self) -> "TimedProtocol":
        """Return the connection that has waited longest for a request, of the address with the most connections."""
        others = cast("list[TimedProtocol]", list(self.connections))
        count = Counter(other.address for other in others)
        waiting = [other for other in others if other.waits]
        return min(waiting, key=lambda other: (-count[other.address], other.waiting_since))

    def _wait_for_head(self) -> None:
        self._head = self._head or self.loop.call_later(HEADER_SECONDS, self.transport.abort)


def encrypted_protocol(context: ssl.SSLContext) -> type[TimedProtocol]:
    """Return the protocol for HTTPS with the certificate of `context`."""

    class EncryptedProtocol(TimedProtocol):
        tls = context

    return EncryptedProtocol


def _stopped(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()
