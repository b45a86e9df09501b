"""One client's requests, answers and lease are of no use to another."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from keyed import asked

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.paths import keys_folder
from pzctl.daemon.wire.curve_keys import ClientKey, make_client, make_server
from pzctl.daemon.wire.frames import to_json
from pzctl.models.build import Build


@pytest.fixture
def clients(tmp_path: Path, start_daemon: Callable[..., Location]) -> tuple[Location, ClientKey, ClientKey]:
    """Return where a daemon is, and the keys of Ana and Ben, who may measure and command the bench."""
    make_server(keys_folder(tmp_path))
    ana, ben = (make_client(keys_folder(tmp_path), name, "bench") for name in ("ana", "ben"))
    return start_daemon(), ana, ben


def measure(build: Build, number: str, step: str = "disk", lease: object = None) -> dict[str, object]:
    """Return a request of a client that counts its requests."""
    sent = json.loads(to_json(build))
    return {"request": "measure", "id": number, "build": sent, "step": step, "lease": lease}


def test_two_clients_that_count_their_requests_get_answers_of_their_own(
    clients: tuple[Location, ClientKey, ClientKey], build: Build
) -> None:
    where, ana, ben = clients
    hers, his = (asked(where, key, measure(build, "1")) for key in (ana, ben))
    assert hers["measurement"] != his["measurement"]
    assert asked(where, ana, measure(build, "1")) == hers, "sent again, it is answered again and not done again"


def test_an_id_that_comes_with_other_content_is_refused(
    clients: tuple[Location, ClientKey, ClientKey], build: Build
) -> None:
    where, ana, _ = clients
    first = asked(where, ana, measure(build, "1"))
    second = asked(where, ana, measure(build, "1", "ml1"))
    assert "measurement" in first
    assert second["error"]["code"] == "id-in-use"


def test_a_lease_is_of_use_to_its_own_key_alone(clients: tuple[Location, ClientKey, ClientKey], build: Build) -> None:
    where, ana, ben = clients
    take = {"request": "lease", "id": "1", "owner": "ana", "seconds": 60.0}
    lease = asked(where, ana, take)["lease"]
    overheard = asked(where, ben, take)
    assert overheard["error"]["code"] == "leased", "who repeats her request does not get her answer"
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
