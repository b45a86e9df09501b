"""Measurements of the simulated analyzer: time per point, exchanges per second, a million malformed messages."""

import random
import socket
import time

import numpy as np

from pzctl.sim.bench.bench import Bench
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.instrument.axis import plain_axis
from pzctl.sim.instrument.instrument import Instrument
from pzctl.sim.instrument.settings import TABLE
from pzctl.sim.instrument.sweep_timing import point_seconds
from pzctl.sim.language.commands import COMMANDS, QUERIES
from pzctl.sim.language.dialect import execute
from pzctl.sim.language.messages import CommandError, parse
from pzctl.sim.server import SimOptions, running


def connect(port):
    link = socket.create_connection(("127.0.0.1", port))
    return link, link.makefile("rb")


def test_time_per_point_compared_with_the_model():
    print("\nBWFACT  model ms/point  measured ms/point (times 1/scale)")
    scale = 0.02
    with running(SimOptions(port=0, bench_port=0, time_scale=scale)) as sim:
        link, stream = connect(sim.port)
        for bandwidth in (1, 2, 3, 4, 5):
            axis = plain_axis(
                parameter="FREQ", kind="LIN", start=1e6, stop=3e6, points=201, fixed_frequency=1e3, level=0.5,
                bandwidth=bandwidth, point_average=1,
            )  # fmt: skip
            model = point_seconds(axis).sum()
            link.sendall(f"*RST;STAR 1 MHZ;STOP 3 MHZ;BWFACT {bandwidth};*OPC?\n".encode())
            stream.readline()
            began = time.perf_counter()
            link.sendall(b"SING;*OPC?\n")
            stream.readline()
            took = (time.perf_counter() - began) / scale
            print(f"{bandwidth:6d}  {model / 201 * 1e3:14.2f}  {took / 201 * 1e3:14.2f}")
            assert took >= 0.99 * model
        stream.close()
        link.close()


def test_exchanges_and_sweeps_per_second():
    with running(SimOptions(port=0, bench_port=0, time_scale=0)) as sim:
        link, stream = connect(sim.port)
        link.sendall(b"*RST;STAR 1 MHZ;STOP 6 MHZ;POIN 801;FORM3\n")
        began = time.perf_counter()
        for _ in range(2000):
            link.sendall(b"POIN?\n")
            stream.readline()
        print(f"\nexchanges per second: {2000 / (time.perf_counter() - began):.0f}")
        for step in ("disk", "ml1", "ml2"):
            bench_command("127.0.0.1", sim.bench_port, command="step", name=step)
            began = time.perf_counter()
            for _ in range(20):
                link.sendall(b"SING;*OPC?;OUTPDATA?\n")
                stream.readline()
                stream.read(8 + 12816 + 1)
            print(f"801-point sweep of {step}, read as FORM3: {(time.perf_counter() - began) / 20 * 1e3:.1f} ms")
        stream.close()
        link.close()


def test_a_million_malformed_messages():
    rng, now = random.Random(4294), [0.0]  # noqa: S311  # messages, not secrets
    instrument = Instrument(Bench(), clock=lambda: now[0])
    headers = [*COMMANDS, *TABLE, *(f"{q}?" for q in [*QUERIES, *TABLE])]
    tails = ["", " 0", " 1", " ON", " -1", " 1E9", ' "a"', " LOG", " LIST", " #14abcd", " 1,2", " 40 HZ", " B", " nan"]
    refused = 0
    for _ in range(1_000_000):
        now[0] += 100 * (rng.random() < 0.01)
        message = bytearray((rng.choice(headers) + rng.choice(tails)).encode())
        for _ in range(rng.choice((0, 0, 1, 3))):
            message[rng.randrange(len(message))] = rng.randrange(256)
        try:
            for unit in parse(bytes(message)):
                execute(instrument, unit)
        except CommandError:
            refused += 1
    print(f"\na million messages, none raised anything but the instrument's own errors ({refused} were not even words)")
    assert np.isfinite(instrument.bench.seconds)
