"""A fitter can answer only under its own name and about its own sweeps, and is removed when it disconnects."""

import json
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
import zmq

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.auto_diagnosis import DIAGNOSIS
from pzctl.daemon.files.paths import keys_folder
from pzctl.daemon.files.worker_limits import Limits
from pzctl.daemon.server.workers.pending_results import PendingResults
from pzctl.daemon.server.workers.supervisor import Supervisor
from pzctl.daemon.server.workers.visitors import LEASE, Visitors
from pzctl.daemon.wire.curve_keys import LOCAL, ClientKey, make_client, make_server
from pzctl.daemon.wire.replies import FitterState
from pzctl.daemon.wire.socket_options import unlock
from pzctl.models.build import Build

Ask = Callable[..., dict[str, object]]
ECHO = "guest_examples:Echo"


@pytest.fixture
def asks(tmp_path: Path, start_daemon: Callable[..., Location]) -> Iterator[tuple[Ask, Ask]]:
    """Return functions that send requests with Ana's and with Ben's key; both may measure and submit fits."""
    make_server(keys_folder(tmp_path))
    keys = [make_client(keys_folder(tmp_path), name, "measure") for name in ("ana", "ben")]
    where = start_daemon("Echo")
    with ExitStack() as stack:
        context = stack.enter_context(zmq.Context())

        def asker(key: ClientKey) -> Ask:
            link = stack.enter_context(context.socket(zmq.REQ))
            link.linger = 0
            unlock(link, key)
            link.connect(where.requests)
            numbers = iter(range(1000))

            def ask(request: str, **words: object) -> dict[str, object]:
                link.send(json.dumps({"id": str(next(numbers)), "request": request, **words}).encode())
                assert link.poll(30_000)
                return json.loads(link.recv_multipart()[0])

            return ask

        yield asker(keys[0]), asker(keys[1])


def answer(measurement: str, sweeps: list[str], fitter: str = "anas", **words: object) -> dict[str, object]:
    return {"measurement": measurement, "fitter": fitter, "version": "1", "sweeps": sweeps, "error": "none", **words}


def code(answered: dict[str, object]) -> object:
    return answered["error"]["code"] if "error" in answered else "ok"  # type: ignore[index]


def test_nobody_answers_under_the_name_of_another_fitter(asks: tuple[Ask, Ask], build: Build) -> None:
    ana, ben = asks
    with connect() as lab:
        measured = lab.measure(build, "disk")
        lab.wait_fit(ECHO, measured.id)
        sweeps = [sweep.id for sweep in measured.sweeps]
        assert code(ana("hello", fitter="anas", version="1")) == "ok"
        assert code(ben("hello", fitter="anas", version="2")) == "not-allowed"
        assert code(ben("submit", **answer(measured.id, sweeps))) == "not-allowed"
        for own in (ECHO, DIAGNOSIS):
            assert code(ben("hello", fitter=own, version="1")) in ("not-allowed", "bad-name")
            assert code(ben("submit", **answer(measured.id, sweeps, own, version="9"))) == "not-allowed"
        assert code(ana("submit", **answer(measured.id, sweeps))) == "ok"
        assert sorted({one.event.fitter for one in lab.fits(measured.id)}) == ["anas", ECHO]
        assert {one.name: one.version for one in lab.hello().fitters} == {ECHO: "1", "anas": "1"}, "no other is listed"


def test_nobody_answers_about_sweeps_that_it_was_not_asked_for(asks: tuple[Ask, Ask], build: Build) -> None:
    ana, _ = asks
    with connect() as lab:
        disk, ml1, other = (
            lab.measure(one, step)
            for one, step in ((build, "disk"), (build, "ml1"), (replace(build, name="S5"), "disk"))
        )
        of_disk, of_ml1, of_other = ([sweep.id for sweep in one.sweeps] for one in (disk, ml1, other))
        for measurement, sweeps in (
            (disk.id, of_other),
            (disk.id, [*of_disk, *of_other]),
            (disk.id, [*of_disk, *of_ml1]),
            (ml1.id, of_disk),
            (disk.id, [*of_disk, "nonsense"]),
            (disk.id, []),
        ):
            assert code(ana("submit", **answer(measurement, sweeps))) == "no-such-sweep"
        aside = lab.measure(build, "disk", decides=disk.id)
        assert code(ana("submit", **answer(aside.id, [sweep.id for sweep in aside.sweeps]))) == "not-measured"
        assert code(ana("submit", **answer(ml1.id, [*of_disk, *of_ml1]))) == "ok"


def test_a_disconnected_fitter_is_removed_and_its_name_is_free(tmp_path: Path) -> None:
    now = 0.0
    told: list[str] = []
    supervisor = Supervisor(
        tmp_path,
        "",
        "",
        None,
        limits=Limits(),
        pending=PendingResults(["mason"]),
        changed=lambda state, says: told.append(f"{state.name} {state.state} {says}".strip()),
        died=lambda _: None,
        visitors=Visitors(["mason"], lambda: now),
    )
    visitors = supervisor.visitors
    for name, client in (("anas", "ana"), ("bens", "ben"), ("mason", LOCAL)):
        visitors.heard(name, client)
        supervisor.ready(name, "1")
    now = LEASE
    visitors.renew("bens", "ben")
    visitors.renew("anas", "ben")
    assert visitors.belongs_to_another("anas", "ben")
    supervisor.forget_silent()
    assert [*supervisor.states] == ["anas", "bens", "mason"]
    now = LEASE + 1
    supervisor.forget_silent()
    assert [*supervisor.states] == ["bens", "mason"], "the daemon's own fitters stay"
    assert told[-1] == f"anas ended silent for {LEASE:g} s"
    assert not visitors.belongs_to_another("anas", "ben")
    assert supervisor.states["bens"] == FitterState("bens", "ready", "1")
