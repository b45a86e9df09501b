"""A GPIB-Ethernet adapter like those of Prologix (and AR488) in front of the instrument: `++` commands and data lines.

A line that starts with `++` is for the adapter; any other line goes to the addressed device. Escape (27) before
`+`, newline, return or escape makes it data. `++read` gives up after `++read_tmo_ms`, as the real adapter does: a
client that sends `*OPC?` in a long sweep has to poll.
"""

import asyncio
import contextlib
from collections.abc import Awaitable, Callable, Iterator, Mapping

from .gpib import ADDRESS, GpibDevice

VERSION = "Prologix GPIB-ETHERNET Controller version 1.6.6.0"
ESCAPE = 27
LINE_LIMIT = 1 << 20

CONFIGURATION: Mapping[str, tuple[int, int, int]] = {
    "mode": (0, 1, 1),
    "auto": (0, 1, 0),
    "addr": (0, 30, ADDRESS),
    "read_tmo_ms": (1, 3000, 200),
    "eos": (0, 3, 0),
    "eoi": (0, 1, 1),
    "eot_enable": (0, 1, 0),
    "eot_char": (0, 255, 0),
    "savecfg": (0, 1, 0),
    "lon": (0, 1, 0),
    "status": (0, 255, 0),
}
"""Settings of the adapter with minimum, maximum and initial value."""


class LineCutter:
    """Cuts the stream into lines and removes the escapes."""

    def __init__(self) -> None:
        self._line = bytearray()
        self._escaped = False
        self._command = True

    def feed(self, data: bytes) -> Iterator[tuple[bool, bytes]]:
        """Yield (is for the adapter, line without its end) for each complete line that is not empty."""
        for byte in data:
            if self._escaped:
                self._command = self._command and len(self._line) >= 2
                self._line.append(byte)
                self._escaped = False
            elif byte == ESCAPE:
                self._escaped = True
            elif byte in b"\r\n":
                if self._line:
                    yield self._command and self._line.startswith(b"++"), bytes(self._line)
                self._line.clear()
                self._command = True
            elif len(self._line) < LINE_LIMIT:
                self._line.append(byte)


class Adapter:
    """One client's adapter."""

    def __init__(self, device: GpibDevice, send: Callable[[bytes], Awaitable[None]], gone: Callable[[], bool]) -> None:
        self._device, self._send, self._gone = device, send, gone
        self._set = {name: value for name, (_, _, value) in CONFIGURATION.items()}
        self._actions: Mapping[str, Callable[[list[str]], Awaitable[None]]] = {
            "read": self._read,
            "spoll": self._serial_poll,
            "srq": lambda _: self._say(str(int(self._device.service_requested()))),
            "clr": self._clear,
            "trg": lambda _: self._to_device(b"*TRG"),
            "ver": lambda _: self._say(VERSION),
            "ifc": self._nothing,
            "loc": self._nothing,
            "llo": self._nothing,
            "rst": self._nothing,
        }

    async def line(self, command: bool, text: bytes) -> None:
        """Carry out one line."""
        if command:
            await self._command(text[2:].decode("latin-1").split())
            return
        await self._to_device(text)
        if self._set["auto"]:
            await self._read([])

    async def _command(self, words: list[str]) -> None:
        name, arguments = (words[0].lower(), words[1:]) if words else ("", [])
        if name in self._actions:
            await self._actions[name](arguments)
        elif name in CONFIGURATION and not arguments:
            await self._say(str(self._set[name]))
        elif name in CONFIGURATION and arguments[0].isdecimal():
            low, high, _ = CONFIGURATION[name]
            self._set[name] = min(max(int(arguments[0][:6]), low), high)
        else:
            await self._say("Unrecognized command")

    def _addressed(self) -> bool:
        return self._set["addr"] == ADDRESS

    async def _to_device(self, text: bytes) -> None:
        if self._addressed():
            await self._device.write(text)

    async def _read(self, _: list[str]) -> None:
        seconds = self._set["read_tmo_ms"] / 1e3
        if not self._addressed():
            await asyncio.sleep(seconds)
        elif answer := await self._device.read(seconds, self._gone):
            tail = bytes([self._set["eot_char"]]) if self._set["eot_enable"] else b""
            await self._send(answer + tail)

    async def _serial_poll(self, arguments: list[str]) -> None:
        other = bool(arguments) and arguments[0] != str(ADDRESS)
        await self._say("0" if other or not self._addressed() else str(self._device.serial_poll()))

    async def _clear(self, _: list[str]) -> None:
        if self._addressed():
            self._device.clear()

    async def _nothing(self, _: list[str]) -> None:
        """Do nothing: the instrument ignores these bus lines."""

    async def _say(self, text: str) -> None:
        await self._send(text.encode("ascii") + b"\r\n")


async def serve_prologix(device: GpibDevice, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """Serve one client of the adapter until it disconnects."""

    async def send(data: bytes) -> None:
        writer.write(data)
        await writer.drain()

    adapter, lines = Adapter(device, send, reader.at_eof), LineCutter()
    with contextlib.suppress(ConnectionError):
        while data := await reader.read(65_536):
            for command, text in lines.feed(data):
                await adapter.line(command, text)
