"""The instrument on a GPIB bus: an input queue, one output queue, serial poll and service request (PM p.474-480)."""

import asyncio
import contextlib
from collections import deque
from collections.abc import Callable

from ..language.messages import CommandError
from .exchange import ConnectionDropped, Exchange

ADDRESS = 17
"""The factory's GPIB address."""

INPUT_LIMIT = 64
"""Most messages queued behind a blocking one; a real bus would make the controller wait instead."""

GONE_SECONDS = 0.05
"""Interval at which a read checks whether its controller is gone."""


class GpibDevice:
    """The instrument as a controller on the bus sees it. One event loop at a time."""

    def __init__(self, exchange: Exchange) -> None:
        self._exchange = exchange
        self._input: asyncio.Queue[bytes] = asyncio.Queue(INPUT_LIMIT)
        self._output: deque[bytes] = deque()
        self._arrived = asyncio.Event()
        self._busy = False
        self._worker = asyncio.get_running_loop().create_task(self._work())

    def available(self) -> bool:
        """Return whether an answer is waiting to be read (MAV)."""
        return bool(self._output)

    async def write(self, message: bytes) -> None:
        """Accept a program message. An unread answer is lost: query interrupted."""
        if self._output:
            self._output.clear()
            self._exchange.instrument.status.error(CommandError(-410))
        self._busy = True
        await self._input.put(message)

    async def read(self, seconds: float, gone: Callable[[], bool]) -> bytes:
        """Return the next answer with its newline; empty after the timeout, or if its controller is `gone`.

        A read without a query queues an error: query unterminated.
        """
        if not self._output and not self._busy:
            self._exchange.instrument.status.error(CommandError(-420))
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(seconds):
                while not self._output and not gone():
                    self._arrived.clear()
                    with contextlib.suppress(TimeoutError):
                        await asyncio.wait_for(self._arrived.wait(), GONE_SECONDS)
        return self._output.popleft() if self._output and not gone() else b""

    def serial_poll(self) -> int:
        """Return the status byte with RQS, and clear the service request."""
        self._exchange.instrument.advance()
        return self._exchange.instrument.status.serial_poll(self.available())

    def service_requested(self) -> bool:
        """Return whether the SRQ line is asserted."""
        self._exchange.instrument.advance()
        return self._exchange.instrument.status.requested

    def clear(self) -> None:
        """Device clear: drop both queues and end the blocking command. Sweeps continue."""
        self._worker.cancel()
        self._output.clear()
        self._input, self._busy = asyncio.Queue(INPUT_LIMIT), False
        self._worker = asyncio.get_running_loop().create_task(self._work())

    async def close(self) -> None:
        """Leave the bus."""
        self._worker.cancel()
        await asyncio.gather(self._worker, return_exceptions=True)

    async def _work(self) -> None:
        """Carry out the messages one after another."""
        while True:
            message = await self._input.get()
            with contextlib.suppress(ConnectionDropped):  # a bus has no connection that a fault could drop
                await self._exchange.message(message, self._answer, self.available)
            self._busy = not self._input.empty()

    async def _answer(self, answer: bytes) -> None:
        self._output.append(answer)
        self._exchange.instrument.status.answer_waits()
        self._arrived.set()
