"""A plain socket to the simulated instrument, as in any script."""

import socket
from collections.abc import Iterator

import numpy as np
import pytest

from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.server import SimOptions, Simulator, running


class Wire:
    """One client of a raw socket."""

    def __init__(self, port: int, timeout: float = 60.0) -> None:
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=timeout)
        self.socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # else a message after another waits 40 ms
        self.stream = self.socket.makefile("rb")

    def say(self, message: str | bytes) -> None:
        self.socket.sendall(message.encode() + b"\n" if isinstance(message, str) else message)

    def line(self) -> str:
        return self.stream.readline().decode()

    def ask(self, message: str) -> str:
        self.say(message)
        answer = self.line()
        assert answer.endswith("\n"), answer
        return answer[:-1]

    def numbers(self, message: str) -> np.ndarray:
        return np.array([float(x) for x in self.ask(message).split(",")])

    def block(self, message: str, dtype: str) -> np.ndarray:
        self.say(message)
        head = self.stream.read(8)
        assert head[:2] == b"#6"
        data = self.stream.read(int(head[2:]))
        assert self.stream.read(1) == b"\n"
        return np.frombuffer(data, dtype).astype(float)

    def impedance(self) -> np.ndarray:
        pairs = self.block("FORM3;OUTPDATA?", ">f8")
        return pairs[0::2] + 1j * pairs[1::2]

    def errors(self) -> list[str]:
        found = []
        while not (error := self.ask("OUTPERRO?")).startswith("0,"):
            found.append(error)
        return found

    def close(self) -> None:
        self.stream.close()
        self.socket.close()


class Lab:
    """A simulator, clients to it, and its bench."""

    def __init__(self, sim: Simulator) -> None:
        self.sim = sim
        self.wires: list[Wire] = []

    def wire(self, port: int | None = None, timeout: float = 10.0) -> Wire:
        self.wires.append(Wire(port or self.sim.port, timeout))
        return self.wires[-1]

    def bench(self, command: str, **values: object) -> dict:
        return bench_command("127.0.0.1", self.sim.bench_port, command=command, **values)


@pytest.fixture
def lab_with():
    """Start simulators with given options; by default with free ports and without waiting."""
    labs: list[tuple[object, Lab]] = []

    def start(**options: object) -> Lab:
        context = running(SimOptions(**{"port": 0, "bench_port": 0, "time_scale": 0.0, **options}))
        labs.append((context, Lab(context.__enter__())))
        return labs[-1][1]

    yield start
    for context, lab in labs:
        for wire in lab.wires:
            wire.close()
        context.__exit__(None, None, None)


@pytest.fixture
def lab(lab_with) -> Lab:
    return lab_with()


@pytest.fixture
def wire(lab) -> Iterator[Wire]:
    client = lab.wire()
    client.say("*RST;*CLS")
    return client
