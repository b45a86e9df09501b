"""The client receives every event although PUB/SUB loses some: gaps, late joiners, restarts, slow readers."""

import signal
import threading
from collections.abc import Callable, Iterator

import pytest
import zmq
from keyed import served, unlocked

from pzctl.daemon.client.client import Client, connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.wire.events import StateEvent, SweepEvent
from pzctl.models.build import Build


@pytest.fixture
def lossy() -> Iterator[Callable[[str], str]]:
    """Return a function that inserts a proxy which loses two of three events."""
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    ends: list[threading.Thread] = []
    stop = threading.Event()

    def between(events: str) -> str:
        front = context.socket(zmq.XPUB)
        front.setsockopt(zmq.XPUB_WELCOME_MSG, b"welcome.")
        served(front)
        port = front.bind_to_random_port("tcp://127.0.0.1")
        ends.append(threading.Thread(target=carry, args=(events, front)))
        ends[-1].start()
        return f"tcp://127.0.0.1:{port}"

    def carry(events: str, front: "zmq.Socket[bytes]") -> None:
        with context.socket(zmq.SUB) as back, front:
            back.subscribe(b"")
            unlocked(back).connect(events)
            heard = 0
            while not stop.is_set():
                if front.poll(5):
                    front.recv_multipart()
                if back.poll(5):
                    frames = back.recv_multipart()
                    heard += 1
                    if heard % 3 == 0 and frames[0] != b"welcome.":
                        front.send_multipart(frames)

    yield between
    stop.set()
    for end in ends:
        end.join()
    context.term()


def seqs_of(lab: Client) -> list[int]:
    return [heard.event.seq for heard in lab.replay(1)]


def test_no_event_is_lost_over_a_lossy_connection(start_daemon, build: Build, lossy) -> None:
    where: Location = start_daemon()
    with connect(lossy(where.events), where.requests) as lab:
        events = lab.listen(patience=60)
        with connect() as other:
            for _ in range(10):
                other.measure(build, "disk")
            newest = other.hello().seq
        heard = []
        while not heard or heard[-1].event.seq < newest:
            heard.append(next(events))
        first = heard[0].event.seq
        assert [one.event.seq for one in heard] == list(range(first, newest + 1))
        sweeps = [one for one in heard if isinstance(one.event, SweepEvent)]
        assert len(sweeps) == 20
        assert all(one.sweep().impedance.size in (51, 41) for one in sweeps)


def test_a_late_listener_gets_earlier_events_from_the_journal(start_daemon, build: Build) -> None:
    start_daemon()
    with connect() as lab:
        for _ in range(15):
            lab.measure(build, "disk")
        newest = lab.hello().seq
        assert newest > 50, "more than fits into one answer"
        assert seqs_of(lab) == list(range(1, newest + 1))
        assert [heard.event.seq for heard in lab.replay(7, 9)] == [7, 8, 9]


def test_a_reader_that_never_reads_does_not_delay_others(start_daemon, build: Build) -> None:
    where = start_daemon()
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    with context.socket(zmq.SUB) as sleeper:
        sleeper.setsockopt(zmq.RCVHWM, 1)
        sleeper.subscribe(b"")
        unlocked(sleeper).connect(where.events)
        sleeper.recv()
        with connect() as lab:
            for _ in range(10):
                assert len(lab.measure(build, "disk").sweeps) == 2
    context.term()


def test_a_listener_survives_a_restart_of_the_daemon(start_daemon, build: Build, end) -> None:
    where = start_daemon(time_scale=1.0)
    with connect() as lab:
        events = lab.listen(patience=60)
        measurement = lab.begin(build, "disk")
        said = [next(events).event]
        while not (isinstance(said[-1], StateEvent) and said[-1].state == "measuring"):
            said.append(next(events).event)
        end(where.pid, signal.SIGKILL)
        again = start_daemon(events=where.events, requests=where.requests)
        while not (isinstance(said[-1], StateEvent) and said[-1].state == "abandoned"):
            said.append(next(events).event)
        assert said[-1].measurement == measurement
        assert said[-1].run == again.run > where.run
        assert [event.seq for event in said] == list(range(said[0].seq, said[0].seq + len(said)))
