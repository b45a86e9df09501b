"""A client cannot use another client's requests, answers or lease."""

import json
import socket
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
import zmq
from keyed import asked

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.paths import keys_folder
from pzctl.daemon.server.requests.answer_memory import REMEMBERED
from pzctl.daemon.server.requests.request_server import AT_ONCE
from pzctl.daemon.wire.curve_keys import ClientKey, make_client, make_server
from pzctl.daemon.wire.frames import to_json
from pzctl.daemon.wire.socket_options import unlock
from pzctl.models.build import Build, Step
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.server import SimOptions
from pzctl.sim.server import running as simulator


@pytest.fixture
def clients(tmp_path: Path, start_daemon: Callable[..., Location]) -> tuple[Location, ClientKey, ClientKey]:
    """Return a daemon's addresses, and the keys of Ana and Ben, who may measure and command the bench."""
    make_server(keys_folder(tmp_path))
    ana, ben = (make_client(keys_folder(tmp_path), name, "bench") for name in ("ana", "ben"))
    return start_daemon(time_scale=0.05), ana, ben


def measure(build: Build, number: str, step: str = "disk", lease: object = None) -> dict[str, object]:
    """Return a request of a client that numbers its requests."""
    sent = json.loads(to_json(build))
    return {"request": "measure", "id": number, "build": sent, "step": step, "lease": lease}


def test_two_clients_that_count_their_requests_get_answers_of_their_own(
    clients: tuple[Location, ClientKey, ClientKey], build: Build
) -> None:
    where, ana, ben = clients
    hers, his = (asked(where, key, measure(build, "1")) for key in (ana, ben))
    assert hers["measurement"] != his["measurement"]
    assert asked(where, ana, measure(build, "1")) == hers, (
        "a repeated request gets its answer and is not executed again"
    )


def test_an_id_that_comes_with_other_content_is_refused(
    clients: tuple[Location, ClientKey, ClientKey], build: Build
) -> None:
    where, ana, _ = clients
    first = asked(where, ana, measure(build, "1"))
    second = asked(where, ana, measure(build, "1", "ml1"))
    assert "measurement" in first
    assert second["error"]["code"] == "id-in-use"


def link_of(context: "zmq.Context[zmq.Socket[bytes]]", where: Location, key: ClientKey) -> "zmq.Socket[bytes]":
    """Return a socket that sends many requests before it reads their answers."""
    link = context.socket(zmq.DEALER)
    link.linger = 0
    link.rcvtimeo = 30_000
    unlock(link, key)
    link.connect(where.requests)
    return link


def test_refused_requests_displace_no_answer_of_one_that_was_carried_out(
    clients: tuple[Location, ClientKey, ClientKey],
) -> None:
    """Ana glues a layer. However much is refused, to Ben or to her, her repeated request does not glue another one."""
    where, ana, ben = clients
    glued = asked(where, ana, glue("once", command="next"))
    with zmq.Context() as context:
        for key in (ben, ana):
            with link_of(context, where, key) as link:
                for k in range(REMEMBERED + 1):
                    link.send(to_json({"request": "release", "id": f"refused-{k}", "lease": "none"}))
                    assert json.loads(link.recv())["error"]["code"] == "no-such-lease"
            assert asked(where, ana, glue("once", command="next")) == glued
    with connect() as lab:
        assert lab.bench({"command": "status"})["step"] == glued["answer"]["step"]


def test_a_lease_is_of_use_to_its_own_key_alone(clients: tuple[Location, ClientKey, ClientKey], build: Build) -> None:
    where, ana, ben = clients
    take = {"request": "lease", "id": "1", "owner": "ana", "seconds": 60.0}
    lease = asked(where, ana, take)["lease"]
    overheard = asked(where, ben, take)
    assert overheard["error"]["code"] == "leased", "another client that repeats her request does not get her answer"
    for request in (
        measure(build, "2", lease=lease),
        {"request": "cancel", "id": "3"},
        {"request": "bench", "id": "4", "command": {"command": "step", "name": "ml1"}},
        {"request": "release", "id": "5", "lease": lease},
    ):
        assert asked(where, ben, request)["error"]["code"] in ("leased", "no-such-lease")
    assert "measurement" in asked(where, ana, measure(build, "6", lease=lease))
    assert "error" not in asked(where, ana, {"request": "release", "id": "7", "lease": lease})
    with connect() as lab:
        assert lab.status().lease is None


def glue(number: str, **command: object) -> dict[str, object]:
    return {"request": "bench", "id": number, "command": command}


@pytest.mark.parametrize("same_account", [False, True], ids=["two keys", "one key"])
def test_nothing_is_measured_under_the_name_of_another_step_than_was_glued(
    clients: tuple[Location, ClientKey, ClientKey], build: Build, same_account: bool
) -> None:
    """Ana glues, Ben glues the next layer, and Ana measures her step, which no longer exists."""
    where, ana, ben = clients
    ben = ana if same_account else ben
    third = replace(build, steps=(*build.steps, Step("bare", ("disk", "ml1"))))
    assert "error" not in asked(where, ana, glue("1", command="step", name="ml1"))
    assert "error" not in asked(where, ben, glue("2", command="next"))
    refused = asked(where, ana, measure(third, "3", "ml1"))["error"]
    assert refused["code"] == "bench-failed"
    assert f"is at step 'ml2', glued by '{'ana' if same_account else 'ben'}'" in refused["message"]
    assert "measurement" in asked(where, ana, measure(third, "4", "bare")), "a step that the bench does not know"
    with connect() as lab:
        assert [one.step for one in lab.samples()[0].measurements] == ["bare"]


def test_nobody_glues_under_a_measurement(
    clients: tuple[Location, ClientKey, ClientKey], build: Build, wait_until
) -> None:
    where, ana, ben = clients
    slow = replace(build, plan=SweepPlan((Segment(1e6, 2e6, 801),), sweep_average=20))
    assert "error" not in asked(where, ana, glue("1", command="step", name="ml1"))
    first = asked(where, ana, measure(slow, "2", "ml1"))["measurement"]
    second = asked(where, ana, measure(slow, "3", "ml1"))["measurement"]
    for number, command in (("4", {"command": "next"}), ("5", {"command": "new-sample", "seed": 1})):
        assert asked(where, ben, glue(number, **command))["error"]["code"] == "busy"
    assert "error" not in asked(where, ben, glue("6", command="step", name="ml1")), "that changes nothing"
    for number, measurement in (("7", second), ("8", first)):
        asked(where, ana, {"request": "cancel", "id": number, "measurement": measurement})
    with connect() as lab:
        wait_until(lambda: lab.status().measuring is None and not lab.status().queue)
    assert "error" not in asked(where, ben, glue("9", command="next"))


def test_a_lease_is_extended_at_once_during_a_measurement_however_often(
    clients: tuple[Location, ClientKey, ClientKey], build: Build
) -> None:
    where, ana, ben = clients
    long = replace(build, plan=SweepPlan(tuple(Segment(1e6, 6e6, 801) for _ in range(200))))
    lease = asked(where, ana, {"request": "lease", "id": "1", "owner": "ana", "seconds": 60.0})["lease"]
    measuring = asked(where, ana, measure(long, "2", lease=lease))["measurement"]
    extend = {"request": "lease", "owner": "ana", "seconds": 60.0, "lease": lease}
    with zmq.Context() as context, link_of(context, where, ana) as link:
        for k in range(2 * AT_ONCE):
            link.send(to_json(extend | {"id": f"more-{k}"}))
        assert {json.loads(link.recv()).get("lease") for _ in range(2 * AT_ONCE)} == {lease}
    status = asked(where, ben, {"request": "status", "id": "1"})
    assert (status["measuring"], status["lease"]["owner"]) == (measuring, "ana"), "it measured all the time"


def test_a_client_that_waits_for_many_answers_is_refused_and_no_other(
    start_daemon: Callable[..., Location], build: Build, tmp_path: Path
) -> None:
    """The bench does not answer, so that its commands wait."""
    make_server(keys_folder(tmp_path))
    ana, ben = (make_client(keys_folder(tmp_path), name, "bench") for name in ("ana", "ben"))
    with (
        simulator(SimOptions(port=0, bench_port=0, time_scale=0.0)) as sim,
        socket.create_server(("127.0.0.1", 0)) as mute,
    ):
        where = start_daemon(resource=sim.resource, bench=f"127.0.0.1:{mute.getsockname()[1]}")
        with zmq.Context() as context, link_of(context, where, ana) as link:
            for k in (*range(AT_ONCE + 20), 0):  # the first one is sent again, and would wait once more
                link.send(to_json(glue(str(k), command="status")))
            refused = [json.loads(link.recv()) for _ in range(21)]
            assert {answer["error"]["code"] for answer in refused} == {"busy"}
            assert refused[0]["error"]["message"] == f"{AT_ONCE} requests of this client wait for their answers already"
            assert [answer["id"] for answer in refused] == [*map(str, range(AT_ONCE, AT_ONCE + 20)), "0"]
            assert "measurement" in asked(where, ana, measure(build, "m")), "what is not long is answered"
            assert asked(where, ben, {"request": "samples", "id": "s"})["ok"], "and to Ben all is"
