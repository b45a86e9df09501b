"""The other end of the wire, for tests that state the bytes: it remembers settings and records every message.

All it knows of a 4294A is that `X v` sets the answer to `X?`; the test defines everything else.
"""

import contextlib
import socket
import threading
import time
from collections.abc import Callable, Iterator

import pytest

IDN = b"HEWLETT-PACKARD,4294A,MY43202956,REV1.11\n"

POWER_ON = {
    "SWPP": "FREQ", "SWPT": "LIN", "STAR": "+4.00000000000E+01", "STOP": "+1.10000000000E+08", "POIN": "201",
    "SWED": "UP", "SDELT": "0", "PDELT": "0", "BWFACT": "1", "PAVER": "0", "PAVERFACT": "4", "AVER": "0",
    "AVERFACT": "16", "POWMOD": "VOLT", "POWE": "5.000000E-01", "DCMOD": "VOLT", "DCRNG": "M1", "DCV": "0",
    "DCO": "0", "TRGS": "INT", "CONT": "1", "E4TP": "OFF", "CALP": "FIXED", "CALST": "0",
    "COMSTA": "1", "COMSTB": "1", "COMSTC": "0",
}  # fmt: skip

Answer = bytes | tuple[bytes, ...] | Callable[["Peer"], bytes]

PAUSE_SECONDS = 0.3
"""Pause between the pieces of an answer: longer than a single wait of the driver."""


class Peer:
    """`answers[message]` is a list of answers, one each time (the last one for ever); b"" is silence."""

    def __init__(self, answers: dict[str, list[Answer]] | None = None, **memory: str) -> None:
        self.memory = POWER_ON | memory
        self.log: list[str] = []
        self.connections = 0
        self.hang_up_on = ""
        self.answers: dict[str, list[Answer]] = {
            "*IDN?": [IDN],
            "OUTPERRO?": [b'0,"NO ERROR"\n'],
            "*ESR?": [b"0\n"],
            "*STB?": [b"0\n", b"4\n"],
            "*OPC?": [b"1\n"],
        } | (answers or {})
        self._server = socket.create_server(("127.0.0.1", 0))
        self.resource = f"127.0.0.1:{self._server.getsockname()[1]}"
        self._thread = threading.Thread(target=self._serve, daemon=True)

    def answer_to(self, part: str) -> bytes | tuple[bytes, ...]:
        if part in self.answers:
            queue = self.answers[part]
            answer = queue.pop(0) if len(queue) > 1 else queue[0]
            return answer(self) if callable(answer) else answer
        name, _, value = part.partition(" ")
        if value:
            self.memory[name] = {"ON": "1", "OFF": "0"}.get(value, value)
        elif name in ("HOLD", "CONT"):
            self.memory["CONT"] = "1" if name == "CONT" else "0"
        elif name.endswith("?"):
            return self.memory[name[:-1]].encode() + b"\n"
        return b""

    def _serve(self) -> None:
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._server.accept()
                self.connections += 1
                with connection, connection.makefile("rb") as lines:
                    for line in lines:
                        message = line.decode().removesuffix("\n")
                        self.log.append(message)
                        if self.hang_up_on and self.hang_up_on in message:
                            self.hang_up_on = ""
                            break
                        for part in message.split(";"):
                            self._send(connection, self.answer_to(part))

    def _send(self, connection: socket.socket, answer: bytes | tuple[bytes, ...]) -> None:
        first, *others = answer if isinstance(answer, tuple) else (answer,)
        connection.sendall(first)
        for piece in others:
            time.sleep(PAUSE_SECONDS)
            connection.sendall(piece)

    @contextlib.contextmanager
    def running(self) -> Iterator["Peer"]:
        self._thread.start()
        try:
            yield self
        finally:
            self._server.shutdown(socket.SHUT_RDWR)
            self._server.close()
            self._thread.join(5)


@pytest.fixture
def play() -> Iterator[Callable[..., Peer]]:
    """Returns a function that starts a `Peer` with these answers and settings; it is stopped after the test."""
    with contextlib.ExitStack() as stack:
        yield lambda answers=None, **memory: stack.enter_context(Peer(answers, **memory).running())
