"""The audit log records who did what, and changes to it are detected."""

import json
import os
import signal
import sqlite3
import sys
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import run_here
from keyed import asked

from pzctl.daemon.client.location import Location
from pzctl.daemon.files.paths import home, journal_folder, keys_folder
from pzctl.daemon.journal.integrity.audit import audit_entries
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.page.page_client import PageClient
from pzctl.daemon.wire.curve_keys import make_client, make_server
from pzctl.daemon.wire.events import SweepEvent, decode
from pzctl.daemon.wire.frames import to_json
from pzctl.models.build import Build

PZCTL = Path(sys.executable).with_name("pzctl")


def pzctl(*words: str) -> tuple[int, str]:
    ran = run_here(Path(os.environ["PZCTL_HOME"]), *words)
    return ran.returncode, ran.stdout + ran.stderr


def test_whatever_somebody_asked_for_names_their_key_and_the_user(
    start_daemon: Callable[..., Location], build: Build, tmp_path: Path
) -> None:
    make_server(keys_folder(tmp_path))
    ana = make_client(keys_folder(tmp_path), "ana", "bench")
    where = start_daemon(max_bias_V=5.0, time_scale=10.0)  # it still measures when it is cancelled
    request = {"request": "measure", "id": "1", "build": json.loads(to_json(build)), "step": "disk", "by": "eva"}
    asked(where, ana, {"request": "bench", "id": "3", "command": {"command": "step", "name": "disk"}})
    first = asked(where, ana, request)["measurement"]
    asked(where, ana, {"request": "cancel", "id": "2", "measurement": first})
    with PageClient("olga") as lab:
        lab.begin(build, "disk")
        lab.cancel()
    told = json.loads(pzctl("journal", "audit", "--json")[1])["audit"]
    assert [(one["did"], one["client"], one["by"]) for one in told] == [
        ("started", "local", None),
        ("bench", "ana", None),
        ("queued", "ana", "eva"),
        ("cancelling", "ana", None),
        ("queued", "local", "olga"),
        ("cancelling", "local", "olga"),
    ]
    assert "bias up to 5 V" in told[0]["says"]
    assert told[2]["measurement"] == told[3]["measurement"] == first
    assert json.loads(told[1]["says"]) == {"command": "step", "name": "disk"}
    assert "eva (ana)" in pzctl("journal", "audit")[1]


def test_every_sweep_names_who_asked_for_it(start_daemon: Callable[..., Location], build: Build) -> None:
    start_daemon()
    with PageClient("olga") as lab:
        measured = lab.measure(build, "disk").id
    journal = JournalReader(journal_folder(home()))
    try:
        events = [decode(frames).event for frames in journal.sweeps(measured)]
    finally:
        journal.close()
    assert {(event.client, event.by) for event in events if isinstance(event, SweepEvent)} == {("local", "olga")}


@pytest.mark.parametrize("change", ["UPDATE events SET header = replace(header, 'olga', 'eva')", "DELETE FROM events"])
def test_an_entry_that_was_changed_or_removed_is_found(
    start_daemon: Callable[..., Location], build: Build, end: Callable[..., None], change: str
) -> None:
    where = start_daemon()
    with PageClient("olga") as lab:
        lab.measure(build, "disk")
    end(where.pid, signal.SIGTERM)
    journal = JournalReader(journal_folder(home()))
    assert journal.verify() == []
    (seq,) = [one.seq for one in audit_entries(journal.store) if one.by == "olga"]
    journal.close()
    db = sqlite3.connect(journal_folder(home()) / "journal.sqlite")
    db.execute(f"{change} WHERE seq = ?", (seq,))
    db.commit()
    db.close()
    code, told = pzctl("journal", "verify")
    assert code == 1
    assert f"event {seq}" in told
