"""The end of a sweep signalled by service request: through an adapter, and through the event of a VISA library.

There is no GPIB card here. A stand-in library with the methods of `VisaLibraryBase` provides the event, taken from the
simulated instrument's own SRQ line.
"""

import contextlib
import os
import select
import socket
import threading
import time

import numpy as np
import pytest
import pyvisa
from pyvisa.constants import EventType, StatusCode

from pzctl.drivers import open_analyzer
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.server import SimOptions, running

pty, tty = pytest.importorskip("pty"), pytest.importorskip("tty")  # a terminal of Unix

PLAN = SweepPlan((Segment(1e6, 6e6, 101),), bandwidth=4)
SLOWLY = SimOptions(port=0, bench_port=0, time_scale=0.1, prologix_port=0, noise=False)


@pytest.fixture
def sim():
    with running(SLOWLY) as simulator:
        yield simulator


@pytest.fixture
def polls(monkeypatch):
    """How often the status byte was read by serial poll."""
    seen = []
    from pyvisa_py.prologix import PrologixInstrSession

    real = PrologixInstrSession.read_stb
    monkeypatch.setattr(PrologixInstrSession, "read_stb", lambda self: (seen.append(1), real(self))[1])
    return seen


def measured(sim):
    analyzer = open_analyzer(f"PROLOGIX::127.0.0.1:{sim.prologix_port}::17")
    try:
        return analyzer.measure(PLAN)[0]
    finally:
        analyzer.close()


def test_an_adapter_is_polled_instead_of_the_instrument(sim, polls):
    by_gpib = measured(sim)
    by_socket = open_analyzer(sim.resource)
    (straight,) = by_socket.measure(PLAN)
    by_socket.close()
    np.testing.assert_array_equal(by_gpib.impedance, straight.impedance)
    assert 1 <= len(polls) < 10, "half a second of sweep: a look each quarter of a second, and one at its end"


@contextlib.contextmanager
def serial_line(port):
    """A serial line to the adapter: a pseudo-terminal, forwarded to its network port."""
    ours, theirs = pty.openpty()
    tty.setraw(theirs)
    stop = threading.Event()

    def carry(adapter):
        while not stop.is_set():
            ready, _, _ = select.select([ours, adapter], [], [], 0.05)
            if ours in ready:
                adapter.sendall(os.read(ours, 4096))
            if adapter in ready:
                os.write(ours, adapter.recv(4096))

    with socket.create_connection(("127.0.0.1", port)) as adapter:
        adapter.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)  # else a message after another waits 40 ms
        carrier = threading.Thread(target=carry, args=[adapter])
        carrier.start()
        try:
            yield os.ttyname(theirs)
        finally:
            stop.set()
            carrier.join()
            os.close(ours)
            os.close(theirs)


def test_an_adapter_on_a_serial_line(sim):
    with serial_line(sim.prologix_port) as device:
        analyzer = open_analyzer(f"PROLOGIX::{device}::17")
        assert analyzer.hears_requests
        (sweep,) = analyzer.measure(PLAN)
        analyzer.close()
    assert sweep.frequency.size == 101


class Events:
    """The event part of a VISA library, on top of pyvisa-py."""

    def __init__(self, library):
        self.library, self.enabled, self.waits = library, [], []

    def enable_event(self, session, event_type, mechanism, context=None):
        self.enabled.append((session, event_type))
        return StatusCode.success

    def wait_on_event(self, session, event_type, timeout):
        assert (session, event_type) in self.enabled
        self.waits.append(timeout)
        adapter = self.library.sessions[session].interface
        until = time.monotonic() + timeout / 1e3
        while time.monotonic() < until:
            adapter.write_oob(b"++srq\n")
            if adapter.read(32)[0].strip() == b"1":
                return event_type, None, StatusCode.success
            time.sleep(0.01)
        raise pyvisa.VisaIOError(StatusCode.error_timeout)


def test_the_event_of_a_visa_library_ends_the_wait(sim, polls, monkeypatch):
    library = pyvisa.ResourceManager("@py").visalib
    events = Events(library)
    monkeypatch.setattr(library, "enable_event", events.enable_event)
    monkeypatch.setattr(library, "wait_on_event", events.wait_on_event)
    assert measured(sim).frequency.size == 101
    assert {event for _, event in events.enabled} == {EventType.service_request}
    assert events.waits
    assert len(polls) == 1 + len(events.waits)
