"""A client of the raw socket: receives messages, sends answers, and applies faults."""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable

from ..instrument.instrument import Instrument
from ..language.messages import CommandError, Framer
from ..model import Model
from .faults import Fault, Faults

CHUNK = 65_536


class ConnectionDropped(Exception):
    """A fault closes the connection."""


class InFlight:
    """Faults that strike in the middle of a running sweep, or at once if no sweep runs."""

    def __init__(self, instrument: Instrument, model: Model, power_cycle: Callable[[float], None]) -> None:
        self._instrument, self._model, self._power_cycle = instrument, model, power_cycle
        self._tasks: set[asyncio.Task[None]] = set()

    def strike(self, fault: Fault) -> None:
        """Carry out a `power-cycle` or a `meddle` (a change at the front panel)."""
        task = asyncio.get_running_loop().create_task(self._strike(fault))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def _strike(self, fault: Fault) -> None:
        left = self._instrument.sweeper.seconds_left()
        if 0 < left < float("inf"):
            await asyncio.sleep(left / 2)
        if fault.kind == "power-cycle":
            self._power_cycle(fault.seconds)
        else:
            self._model.panel(self._instrument, fault.message.encode("latin-1", "replace"))


class Exchange:
    """Carries program messages to the instrument and applies the faults that strike them."""

    def __init__(self, instrument: Instrument, model: Model, faults: Faults, in_flight: InFlight) -> None:
        self.instrument, self._model, self.faults, self._in_flight = instrument, model, faults, in_flight

    async def message(
        self, text: bytes, answer: Callable[[bytes], Awaitable[None]], available: Callable[[], bool] = lambda: False
    ) -> None:
        """Carry out one message; `answer` is called with each answer and its newline.

        Raises ConnectionDropped if a fault closes the connection.
        """
        due = self.faults.next_exchange()
        for fault in due:
            if fault.kind == "hang":
                self.faults.hang(fault.seconds)
        await self.faults.while_hanging()
        kinds = {fault.kind for fault in due}
        if "ignore" in kinds:
            return
        await self._carry_out(text, answer, available, due)

    async def _carry_out(
        self, text: bytes, answer: Callable[[bytes], Awaitable[None]], available: Callable[[], bool], due: list[Fault]
    ) -> None:
        for fault in due:
            if fault.kind in ("power-cycle", "meddle"):
                self._in_flight.strike(fault)
        dropped = any(fault.kind == "drop" for fault in due)
        async for reply in self._model.perform(self.instrument, text, available):
            if dropped:
                break
            out, cut = self.faults.spoiled(reply + b"\n")
            await answer(out)
            if cut:
                break
        if dropped:
            raise ConnectionDropped


async def serve_socket(exchange: Exchange, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Serve one client of port 5025 until it disconnects."""

    async def answer(data: bytes) -> None:
        writer.write(data)
        await writer.drain()

    framer = Framer()
    with contextlib.suppress(ConnectionError, ConnectionDropped):
        while data := await reader.read(CHUNK):
            try:
                for message in framer.feed(data):
                    await exchange.message(message, answer)
            except CommandError as error:
                exchange.instrument.status.error(error)
