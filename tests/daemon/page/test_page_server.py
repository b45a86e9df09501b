"""The live page without a browser: who may see and command it, and its answers."""

import asyncio
import json
import os
import re
import subprocess
import sys
import time
from contextlib import closing
from dataclasses import replace
from email.message import Message
from email.utils import collapse_rfc2231_value
from pathlib import Path
from typing import Any
from urllib.error import URLError
from urllib.request import urlopen

import numpy as np
import pytest
from page_requests import BUILD, ask
from pruned_hole import endpoints, prune_unheard

from pzctl import connect
from pzctl.daemon.client import event_follower
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.page.event_stream import EventStream
from pzctl.daemon.page.page_guard import is_loopback
from pzctl.daemon.report.probability import probability_text
from pzctl.daemon.wire.events import InstrumentInfo, SampleStep, StateEvent, SweepEvent, sweep_columns
from pzctl.models.build import Build, Step
from pzctl.models.sweep import Sweep

TOKEN = "so-secret"  # noqa: S105


@pytest.fixture(autouse=True)
def _home(tmp_path: Any, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))


def test_without_a_token_only_this_machine_by_its_own_name() -> None:
    assert ask("/")[0] == 200
    assert ask("/", host="evil.example:8294")[0] == 421, "a foreign host name that resolves to this machine"
    assert ask("/", host="localhost:1")[0] == 200


def test_with_a_token_requests_without_it_are_refused() -> None:
    assert ask("/", token=TOKEN, host="10.0.0.7:8294")[0] == 401
    assert ask("/api/now?token=wrong", token=TOKEN)[0] == 401
    status, headers, _ = ask("/?token=so-secret", token=TOKEN, host="10.0.0.7:8294")
    assert (status, headers["location"]) == (303, "/"), "the token leaves the address bar"
    assert "httponly" in headers["set-cookie"].lower()
    assert ask("/", token=TOKEN, host="10.0.0.7:8294", cookie="pzctl-token=so-secret")[0] == 200


def test_commands_come_from_the_page_itself() -> None:
    assert ask("/api/cancel", method="POST", origin="http://evil.example")[0] == 403
    assert ask("/api/cancel", method="POST")[0] == 403
    assert ask("/api/cancel", method="POST", origin="http://[x")[0] == 403, "no address"
    status, _, body = ask("/api/cancel", method="POST", origin="http://127.0.0.1:8294")
    assert (status, b"no daemon runs" in body) == (409, True), "accepted, and answered with a sentence"


def test_the_page_may_load_nothing_from_outside() -> None:
    _, headers, body = ask("/")
    assert "default-src 'self'" in headers["content-security-policy"]
    assert b"://" not in body
    assert ask("/static/uPlot.LICENSE.txt")[2].startswith(b"The MIT License")


def test_missing_data_are_reported_in_a_sentence() -> None:
    status, _, body = ask("/api/record/nothing")
    assert status == 404
    assert b"nothing was measured yet" in body
    assert ask("/api/now")[2].startswith(b'{"daemon":{"there":false')


@pytest.mark.parametrize(
    ("host", "here"), [("127.0.0.1", True), ("::1", True), ("localhost", True), ("10.0.0.7", False), ("lab-pc", False)]
)
def test_recognition_of_this_machine(host: str, here: bool) -> None:
    assert is_loopback(host) == here


def test_by_hand_a_wish_that_cannot_be_is_a_sentence() -> None:
    headers = {"origin": "http://127.0.0.1:8294"}
    status, _, body = ask("/api/look", method="POST", **headers)
    assert (status, b"missing required field `measurement`" in body) == (400, True)


def test_two_sweeps_of_the_journal_are_compared_and_one_that_is_not_there_is_a_sentence(
    tmp_path: Path, build: Build
) -> None:
    journal = JournalWriter(tmp_path / "journal")
    f = np.linspace(0.9e6, 1.1e6, 101)
    jw = 2j * np.pi * f
    Z = 1 / (jw * 5e-10 + jw * 6e-11 / (1 - (f / 1e6) ** 2 + 1j * f / 1e6 / 80))
    names = [put(journal, build, Sweep(f, seen)) for seen in (Z, Z + jw * 3e-6)]
    put(journal, build, Sweep(f, 2 * Z), "ml1")
    journal.close()

    def compared(segment: int) -> tuple[int, Any]:
        pair = {"before": {"measurement": names[0]}, "after": {"measurement": names[1], "segment": segment}}
        body = json.dumps(pair).encode()
        status, _, answer = ask("/api/compare", method="POST", body=body, origin="http://127.0.0.1:8294")
        return status, json.loads(answer)

    status, found = compared(1)
    assert (status, found["verdict"]) == (200, "explained")
    (finding,) = found["findings"]
    assert finding["effect"] in ("series-coil", "lead-inductance")
    assert finding["parameters"]["inductance"]["value"] == pytest.approx(3e-6, rel=0.05)
    assert finding["probability_text"] == probability_text(finding["probability"])
    assert len(found["curve"]["explained"]["re"]) == len(found["curve"]["f"]) == 101
    status, found = compared(2)
    assert (status, found["error"]) == (404, f"{names[1]} has no sweep 2; allowed are 1 to 1")
    names[1] = build.name
    status, found = compared(1)
    assert (status, found["error"]) == (404, f"{build.name} is no measurement but a sample; give the id of one")


def put(journal: JournalWriter, build: Build, sweep: Sweep, step: str = "disk") -> str:
    """Write a measured step of one sweep; return the measurement."""
    measurement, _ = journal.begin_measurement(str(sweep.impedance[0]), build, step)
    sample = SampleStep(build.name, step)
    columns, payload = sweep_columns(sweep)
    instrument = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)
    event = SweepEvent(
        measurement=measurement,
        sample=sample,
        instrument=instrument,
        build=build,
        segment=1,
        segments=1,
        started=sweep.time,
        settings={},
        columns=columns,
    )
    journal.append(event, payload)
    journal.append(StateEvent(state="measured", measurement=measurement, sample=sample))
    return measurement


def reached(address: str) -> bool:
    try:
        with urlopen(address, timeout=2) as answer:  # noqa: S310
            return answer.status == 200
    except (URLError, ConnectionError, TimeoutError):
        return False


def test_a_page_beside_the_daemon_ends_with_it_even_when_that_is_killed() -> None:
    command = [Path(sys.executable).with_name("pzctl"), "daemon", "--page", "--page-port", "0", "--time-scale", "0"]
    daemon = subprocess.Popen(command, stderr=subprocess.PIPE, text=True, env=os.environ)
    assert daemon.stderr is not None
    try:
        address = daemon.stderr.readline().split()[-1]
        assert re.fullmatch(r"http://127\.0\.0\.1:\d+/", address)
        with urlopen(f"{address}api/now", timeout=300) as answer:  # noqa: S310
            assert answer.status == 200, "it listens as soon as its address is told"
    finally:
        daemon.kill()
        daemon.wait(60)
        daemon.stderr.close()
    deadline = time.monotonic() + 120
    while reached(address):
        assert time.monotonic() < deadline, "the page outlived its daemon"
        time.sleep(0.1)


def test_what_was_missed_and_pruned_is_one_sentence(
    start_daemon, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_follower, "SILENCE", 90.0)
    where = start_daemon(**endpoints())

    async def story() -> None:
        heard: asyncio.Queue[dict[str, Any]] = asyncio.Queue()
        stream = EventStream()
        monkeypatch.setattr(stream, "_spread", lambda text: heard.put_nowait(json.loads(text)))
        stream.start()
        assert await heard.get() == {"kind": "daemon", "there": True}
        last = await asyncio.to_thread(prune_unheard, start_daemon, where, tmp_path, build)
        missing, started = await heard.get(), await heard.get()
        assert missing["kind"] == "missing"
        assert f"to {last} are no longer in the journal: pruned on" in missing["says"]
        assert started["state"] == "started"
        stream.stop()

    asyncio.run(asyncio.wait_for(story(), 90))


def test_a_refusal_says_what_to_do(start_daemon, build: Build, wait_until) -> None:
    def pressed(step: str) -> str:
        body = json.dumps({"step": step}).encode()
        status, _, answer = ask("/api/measure", method="POST", body=body, origin="http://127.0.0.1:8294")
        assert status == 409
        return json.loads(answer)["error"]

    start_daemon(time_scale=0.2)
    assert pressed("ml9") == "build 'B' has no step 'ml9'; it has disk"
    with connect() as lab:
        lab.begin(build, "disk")
        assert pressed("disk").startswith("The instrument measures, or a layer is being glued. Wait until it is done")
        lab.cancel()
        wait_until(lambda: lab.status().measuring is None)
        lab.bench({"command": "next"})
    assert re.match(r"The simulated bench cannot do this: .*'disk' is over.* in their order\.", pressed("disk"))


def test_a_step_that_the_bench_does_not_know_is_measured_with_the_device_as_it_is(start_daemon) -> None:
    start_daemon()
    bare = BUILD.replace('[[steps]]\nname = "disk"', '[[steps]]\nname = "bare"')
    bare += "[sweep]\nsegments = [ { start_MHz = 1, stop_MHz = 6, points = 51 } ]\n"
    pressed = {"method": "POST", "body": b'{"step": "bare"}', "origin": "http://127.0.0.1:8294", "build": bare}
    status, _, answer = ask("/api/measure", **pressed)  # type: ignore[arg-type]
    assert status == 200, answer
    with connect() as lab:
        assert [one.step for one in lab.samples()[0].measurements] == ["bare"]


def keep_measurement(home: Path, build: Build, step: str) -> str:
    """Put one measurement with a sweep into the journal and return its id."""
    with closing(JournalWriter(home / "journal")) as journal:
        measurement, _ = journal.begin_measurement(step, build, step)
        columns, payload = sweep_columns(Sweep(np.linspace(1e6, 2e6, 5), np.ones(5) + 1j))
        info = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)
        said = {"instrument": info, "build": build, "segment": 1, "segments": 1, "started": ""}
        sample = SampleStep(build.name, step)
        event = SweepEvent(measurement=measurement, sample=sample, settings={}, columns=columns, **said)
        journal.append(event, payload)
        journal.append(StateEvent(state="measured", measurement=measurement, sample=sample))
    return measurement


def test_a_download_has_the_name_of_its_step_whatever_that_is(tmp_path: Path, build: Build) -> None:
    name = 'm\u00b5"; filename="run.exe'
    measurement = keep_measurement(tmp_path, replace(build, steps=(Step(name, ("disk",)),)), name)
    status, headers, _ = ask(f"/download/{measurement}/1.csv")
    assert status == 200
    message = Message()
    message["Content-Disposition"] = headers["content-disposition"]
    assert collapse_rfc2231_value(message.get_param("filename", header="Content-Disposition")) == f"{name}-1.csv"
    assert set(headers["content-disposition"]) <= set(map(chr, range(32, 127)))


def test_a_download_of_a_sample_with_two_steps_names_its_measurements(tmp_path: Path, build: Build) -> None:
    ids = [keep_measurement(tmp_path, build, step.name) for step in build.steps[:2]]
    status, _, body = ask(f"/download/{build.name}/1.csv")
    said = json.loads(body)["error"]
    assert status == 404
    assert f"{build.name} has 2 measurements; ask for the sweeps of one: {ids[0]} ({build.steps[0].name})" in said
