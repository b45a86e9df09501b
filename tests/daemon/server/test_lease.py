"""The instrument has one owner at a time, and measurements wait for it in order of priority."""

import socket

import pytest

from pzctl import connect
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.server.access.lease import Lease
from pzctl.daemon.server.requests.request_errors import RequestError
from pzctl.daemon.wire.events import StateEvent
from pzctl.models.build import Build
from pzctl.sim.server import SimOptions
from pzctl.sim.server import running as simulator


def test_who_has_a_lease_has_the_instrument(start_daemon, build: Build) -> None:
    with simulator(SimOptions(port=0, bench_port=0, time_scale=0.0)) as sim:
        start_daemon(resource=sim.resource)
        with connect() as lab, connect() as other:
            other.measure(build, "disk")
            with pytest.raises(DaemonError, match="the instrument of this daemon has no simulated bench"):
                lab.bench({"command": "truth"})
            with lab.lease("scan", 30.0) as lease:
                assert other.status().lease.owner == "scan"
                with socket.create_connection(("127.0.0.1", sim.port)) as link, link.makefile("rwb") as lines:
                    lines.write(b"*IDN?\n")
                    lines.flush()
                    assert b"4294A" in lines.readline()
                with pytest.raises(DaemonError, match="the instrument is leased to 'scan' until") as refusal:
                    other.measure(build, "disk")
                assert refusal.value.code == "leased"
                with pytest.raises(DaemonError, match="the instrument is leased to"), other.lease("me"):
                    pass
                assert lab.measure(build, "disk", lease=lease).sweeps
            assert other.status().lease is None
            assert other.measure(build, "ml1").sweeps


def test_higher_priorities_go_first(start_daemon, build: Build) -> None:
    start_daemon(time_scale=0.01)
    with connect() as lab:
        events = lab.listen(patience=60)
        asked = [lab.begin(build, "disk", priority=priority) for priority in (0, -1, 0, 5, 5)]
        with pytest.raises(DaemonError, match="measurements wait for it") as refusal, lab.lease("me"):
            pass
        assert refusal.value.code == "busy"
        ended: list[str | None] = []
        while len(ended) < 5:
            if isinstance(event := next(events).event, StateEvent) and event.state == "measured":
                ended.append(event.measurement)
    first, low, middle, high, high_later = asked
    assert ended == [first, high, high_later, middle, low]


def test_a_lease_expires_and_is_held_for_longer() -> None:
    now = 0.0
    lease = Lease(lambda: now)
    held, _ = lease.take("ana", "a", 10.0, None, busy=False)
    now = 9.0
    assert lease.take("ana", "a", 10.0, held, busy=True)[0] == held
    now = 18.0
    with pytest.raises(RequestError, match="the instrument is leased to 'a'"):
        lease.check("ana", None)
    lease.check("ana", held)
    now = 19.0
    assert lease.holder is None
    lease.check("ana", None)
    with pytest.raises(RequestError, match="has expired, was returned, or never existed"):
        lease.take("ana", "a", 1.0, held, busy=False)
