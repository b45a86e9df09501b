"""The simulator as a process: the raw socket of the instrument, the port of the bench, and their start and stop."""

import asyncio
import contextlib
import json
import signal
import sys
import threading
from collections.abc import Callable, Coroutine, Generator, Mapping
from dataclasses import dataclass, field
from queue import Queue

from .bench.bench import Bench
from .bench.bench_port import BenchPort
from .bench.hidden_effects import hide
from .bench.jig import JIGS
from .bench.sample import BenchSample, sample
from .instrument.instrument import SERIAL, Instrument
from .model import MODELS
from .transport.exchange import Exchange, InFlight, serve_socket
from .transport.faults import Faults
from .transport.ftp import FtpServer
from .transport.gpib import GpibDevice
from .transport.listener import Handler, Listener, SimError
from .transport.prologix import serve_prologix


@dataclass(frozen=True)
class SimOptions:
    """How to start the simulator."""

    model: str = "4294A"
    """One of sim.model.MODELS."""
    port: int = 5025
    """Instrument's raw socket; 0 takes any free port."""
    bench_port: int = 5026
    """The port of the bench; 0 takes any free port."""
    prologix_port: int | None = None
    """Port of a Prologix-like GPIB adapter (usually 1234; 0 takes any free port); None: no adapter."""
    ftp_port: int | None = None
    """Port of the FTP server for the instrument's files (usually 21; 0 takes any free port); None: no server."""
    time_scale: float = 1.0
    """How long a sweep lasts compared with the real instrument; 0 answers at once."""
    seed: int = 0
    """Seed of the sample on the bench and of the noise."""
    jig: str = "compensated"
    """One of sim.bench.jig.JIGS."""
    noise: bool = True
    """Random noise by bandwidth, averaging and level."""
    radial: bool = False
    """Whether the disk has its radial modes as well (0.1 MHz and overtones)."""
    off: bool = False
    """The instrument's systematic error, within its accuracy."""
    hidden: Mapping[str, float] = field(default_factory=dict[str, float])
    """Hidden effects on the bench at the start: sizes (SI) by the names of sim.bench.hidden_effects.KINDS."""
    host: str = "127.0.0.1"
    """Address to listen on."""

    def __post_init__(self) -> None:
        ports = {
            "port": self.port,
            "bench port": self.bench_port,
            "prologix port": self.prologix_port or 0,
            "ftp port": self.ftp_port or 0,
        }
        for name, value in ports.items():
            if not 0 <= value <= 65535:
                raise SimError(f"simulator: {name} is {value}; 0 to 65535 is allowed")
        if not 0 <= self.time_scale <= 1000:
            raise SimError(f"simulator: time scale is {self.time_scale:g}; 0 (at once) to 1000 is allowed")
        if self.seed < 0:
            raise SimError(f"simulator: seed is {self.seed}; 0 or more is allowed")
        if self.jig not in JIGS:
            raise SimError(f"simulator: no jig {self.jig!r}; there are {', '.join(JIGS)}")
        if self.model not in MODELS:
            raise SimError(f"simulator: no model {self.model!r}; there are {', '.join(MODELS)}")


@dataclass
class Simulator:
    """The running simulator: its listeners and the clients they have."""

    options: SimOptions
    draw: Callable[[int], BenchSample] = sample
    """Draws the sample on the bench."""
    port: int = 0
    """The instrument's real port, once it listens."""
    bench_port: int = 0
    prologix_port: int | None = None
    """The adapter's real port; None without one."""
    ftp_port: int | None = None
    """The FTP server's real port; None without one."""
    _gpib: GpibDevice | None = None
    _ftp: FtpServer | None = None
    _listeners: list[Listener] = field(default_factory=list[Listener])
    _off_until: float = 0.0

    @property
    def resource(self) -> str:
        """The VISA resource string of the instrument."""
        return f"TCPIP0::{self.options.host}::{self.port}::SOCKET"

    async def start(self) -> None:
        """Listen on all ports. Raises SimError if one is taken."""
        o = self.options
        bench = Bench(seed=o.seed, noise=o.noise, radial=o.radial, off=o.off, jig=JIGS[o.jig], draw=self.draw)
        hide(bench, o.hidden)
        model = MODELS[o.model]
        self.instrument = Instrument(
            bench, o.time_scale, identity=model.identity.format(serial=SERIAL), set_initial=model.set_initial
        )
        faults = Faults()
        in_flight = InFlight(self.instrument, model, self._power_cycle)
        exchange = Exchange(self.instrument, model, faults, in_flight)
        bench_port = BenchPort(self.instrument, model, faults, in_flight, self._power_cycle)
        self.port = self._listen(o.port, lambda r, w: self._powered(serve_socket(exchange, r, w)))
        self.bench_port = self._listen(o.bench_port, bench_port.serve)
        if o.prologix_port is not None:
            gpib = self._gpib = GpibDevice(exchange)
            self.prologix_port = self._listen(o.prologix_port, lambda r, w: serve_prologix(gpib, r, w))
        if o.ftp_port is not None:
            self._ftp = FtpServer(self.instrument)
            self.ftp_port = await self._ftp.start(o.host, o.ftp_port)

    def _listen(self, port: int, handler: Handler) -> int:
        self._listeners.append(Listener(self.options.host, port, handler))
        return self._listeners[-1].port

    async def _powered(self, service: Coroutine[None, None, None]) -> None:
        """Serve a client of the instrument, or close the connection at once while there is no power."""
        if asyncio.get_running_loop().time() < self._off_until:
            service.close()
        else:
            await service

    def _power_cycle(self, seconds: float) -> None:
        """Fail the mains: disconnect all clients, lose the RAM and refuse connections for this time."""
        self._off_until = asyncio.get_running_loop().time() + seconds
        self._listeners[0].drop_clients()
        if self._gpib is not None:
            self._gpib.clear()
        self.instrument.power_on()

    async def stop(self) -> None:
        """Close the listeners and all connections."""
        for listener in self._listeners:
            await listener.stop()
        if self._gpib is not None:
            await self._gpib.close()
        if self._ftp is not None and self.ftp_port is not None:
            await self._ftp.stop()


async def _serve(
    options: SimOptions,
    draw: Callable[[int], BenchSample],
    ready: Callable[[Simulator], None],
    stop: asyncio.Event,
) -> None:
    simulator = Simulator(options, draw)
    try:
        await simulator.start()
        ready(simulator)
        await stop.wait()
    finally:
        await simulator.stop()


def run(options: SimOptions, draw: Callable[[int], BenchSample] = sample, *, quiet: bool = False) -> None:
    """Run the simulator until SIGTERM or SIGINT; `draw` makes the sample of a seed. Raises SimError if a port is taken.

    When it is ready, it prints a line for people to standard error, unless `quiet`, and a JSON object to standard
    output.
    """

    def ready(simulator: Simulator) -> None:
        bench = f"{options.host}:{simulator.bench_port}"
        if not quiet:
            says = f"simulated {options.model} at {simulator.resource}, its bench at {bench}"
            print(says, file=sys.stderr, flush=True)
        addresses = {"instrument": simulator.resource, "bench": bench}
        if simulator.prologix_port is not None:
            addresses["prologix"] = f"PRLGX-TCPIP0::{options.host}::{simulator.prologix_port}::INTFC"
        if simulator.ftp_port is not None:
            addresses["ftp"] = f"ftp://{options.host}:{simulator.ftp_port}"
        print(json.dumps(addresses), flush=True)

    async def main() -> None:
        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        for number in (signal.SIGTERM, signal.SIGINT):
            try:
                loop.add_signal_handler(number, stop.set)
            except NotImplementedError:  # Windows: Ctrl-C ends asyncio.run itself
                continue
        await _serve(options, draw, ready, stop)

    with contextlib.suppress(KeyboardInterrupt):
        asyncio.run(main())


@contextlib.contextmanager
def running(options: SimOptions | None = None, draw: Callable[[int], BenchSample] = sample) -> Generator[Simulator]:
    """Run a simulator in a thread for a `with` block; by default on free ports and without waiting.

    Raises SimError if a port is taken.
    """
    chosen = options or SimOptions(port=0, bench_port=0, time_scale=0.0)
    handover: Queue[tuple[Simulator, Callable[[], None]] | BaseException] = Queue()

    async def main() -> None:
        stop, loop = asyncio.Event(), asyncio.get_running_loop()
        await _serve(chosen, draw, lambda s: handover.put((s, lambda: _set_from_outside(loop, stop))), stop)

    def thread_main() -> None:
        try:
            asyncio.run(main())
        except BaseException as error:  # the caller waits for it and raises it
            handover.put(error)

    thread = threading.Thread(target=thread_main, name="simulated 4294A", daemon=True)
    thread.start()
    started = handover.get()
    if isinstance(started, BaseException):
        thread.join()
        raise started
    simulator, stop = started
    try:
        yield simulator
    finally:
        stop()
        thread.join()


def _set_from_outside(loop: asyncio.AbstractEventLoop, event: asyncio.Event) -> None:
    loop.call_soon_threadsafe(event.set)
