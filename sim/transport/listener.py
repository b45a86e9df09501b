"""A listening socket and its clients; stopping it closes all of them.

`asyncio.start_server` leaks a connection that arrives while it closes (its socket is never closed); this one does not.
"""

import asyncio
import contextlib
import re
import socket
from collections.abc import Awaitable, Callable, Iterable
from typing import Any, SupportsIndex, TypeAlias

from ...models.base.errors import PzctlError

Handler: TypeAlias = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]
"""Serves one client until it disconnects."""

LINE_LIMIT = 65_536
"""Longest line that `StreamReader.readline` accepts, in bytes."""


_WEB = re.compile(rb"(?:GET|HEAD|POST|PUT|PATCH|DELETE|OPTIONS) [/*h]")
"""First bytes of HTTP requests; no message of these ports begins like this."""

_ENOUGH = 16
"""Number of bytes that tell whether a client is a web browser."""


class _Reader(asyncio.StreamReader):
    """Reads from a client, but rejects a web browser: the text of a page must not be executed as commands."""

    _head: bytes | None = b""

    def feed_data(self, data: Iterable[SupportsIndex]) -> None:
        """Receive data; a browser's connection is treated as reset."""
        data = bytes(data)
        if self._head is not None:
            head = self._head + data[:_ENOUGH]
            if _WEB.match(head):
                self.set_exception(ConnectionAbortedError("a web browser commands no instrument"))
                return
            self._head = head if len(head) < _ENOUGH else None
        if self.exception() is None:
            super().feed_data(data)


class _Accepting(socket.socket):
    """A listening socket that remembers accepted connections: cancelling `sock_accept` can lose one."""

    def __init__(self, fileno: int) -> None:
        super().__init__(fileno=fileno)
        self.accepted: set[socket.socket] = set()

    def accept(self) -> tuple[socket.socket, Any]:
        """Accept a connection, and remember it."""
        connection, address = super().accept()
        self.accepted.add(connection)
        return connection, address


class SimError(PzctlError):
    """The simulator cannot start."""


class Listener:
    """Accepts clients on one port and runs the handler for each in its own task.

    Raises SimError where the port is taken or the address is not of this machine.
    """

    def __init__(self, host: str, port: int, handler: Handler) -> None:
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            self._socket = _Accepting(socket.create_server((host, port), family=family).detach())
        except OSError as error:
            raise SimError(
                f"simulator: cannot listen on {host}:{port} ({error.strerror}); "
                "choose another port, or 0 for any free one"
            ) from error
        self._socket.setblocking(False)
        self._handler = handler
        self._clients: set[asyncio.Task[None]] = set()
        self.port = int(self._socket.getsockname()[1])
        self._accepting = asyncio.get_running_loop().create_task(self._accept())

    def drop_clients(self) -> None:
        """Disconnect every client."""
        for task in self._clients:
            task.cancel()

    async def stop(self) -> None:
        """Stop listening and cut every client off."""
        self._accepting.cancel()
        await asyncio.gather(self._accepting, return_exceptions=True)
        self._socket.close()
        self.drop_clients()
        await asyncio.gather(*self._clients, return_exceptions=True)
        for lost in self._socket.accepted:
            lost.close()

    async def _accept(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            try:
                connection, _ = await loop.sock_accept(self._socket)
            except OSError:  # no file descriptor left, or the client has gone already
                await asyncio.sleep(0.05)
                continue
            task = loop.create_task(self._serve(connection))
            self._clients.add(task)
            task.add_done_callback(lambda done, connection=connection: self._gone(done, connection))

    def _gone(self, task: asyncio.Task[None], connection: socket.socket) -> None:
        self._clients.discard(task)
        self._socket.accepted.discard(connection)
        connection.close()  # the task may have ended before it began

    async def _serve(self, connection: socket.socket) -> None:
        loop = asyncio.get_running_loop()
        reader = _Reader(limit=LINE_LIMIT, loop=loop)
        protocol = asyncio.StreamReaderProtocol(reader, loop=loop)
        transport, _ = await loop.create_connection(lambda: protocol, sock=connection)
        writer = asyncio.StreamWriter(transport, protocol, reader, loop)
        try:
            with contextlib.suppress(ConnectionError):
                await self._handler(reader, writer)
        except asyncio.CancelledError:
            writer.transport.abort()
            raise
        finally:
            writer.close()
            with contextlib.suppress(ConnectionError):
                await writer.wait_closed()
