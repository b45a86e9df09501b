"""Several analyzers under one daemon: each has its own queue, lease, limits, bench and rights."""

import json
import time
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from keyed import asked
from typer.testing import CliRunner

from pzctl import connect
from pzctl.daemon.cli.commands import app
from pzctl.daemon.client.client import Client
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.analyzer_options import AnalyzerOptions
from pzctl.daemon.files.builds.build_file import THESIS_BUILD
from pzctl.daemon.files.config import ConfigError, options, settings
from pzctl.daemon.files.paths import keys_folder
from pzctl.daemon.server.analyzers.acquisition import Acquisition, MeasurementJob
from pzctl.daemon.wire.curve_keys import make_client, make_server, write_secret
from pzctl.daemon.wire.frames import to_json
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

TWO = {"left": AnalyzerOptions(), "right": AnalyzerOptions(max_bias_V=1.0)}


@pytest.fixture
def lab(start_daemon) -> Client:
    start_daemon(analyzers=TWO)
    return connect()


def test_each_measures_its_own_device_and_the_recording_names_it(lab: Client, build: Build) -> None:
    with lab:
        first, second = lab.hello().analyzers
        assert (first.name, second.name) == ("left", "right")
        assert first.instrument.name != second.instrument.name
        lab.bench({"command": "step", "name": "ml1"}, "left")
        thin = lab.measure(build, "disk", analyzer="right").sweeps[0]
        with pytest.raises(DaemonError, match="the device on the bench is at step 'ml1'"):
            lab.measure(build, "disk", analyzer="left")
        thick = lab.measure(build, "ml1").sweeps[0]  # the first one, if none is named
        events = [one.event for name in (thin.id, thick.id) for one in lab.replay(1) if one.event.id == name]
        assert [event.analyzer for event in events] == ["right", "left"]  # type: ignore[union-attr]
        assert [event.instrument.name for event in events] == [second.instrument.name, first.instrument.name]  # type: ignore[union-attr]


def test_one_is_leased_and_limited_without_the_other(lab: Client, build: Build) -> None:
    strong = SweepPlan((Segment(1e6, 6e6, 51),), bias_V=2.0)
    with lab:
        with lab.lease("Ana", analyzer="left") as lease:
            with pytest.raises(DaemonError, match="leased to 'Ana'"):
                lab.begin(build, "disk", analyzer="left")
            assert lab.measure(build, "disk", analyzer="right").sweeps
            assert lab.measure(build, "disk", lease=lease, analyzer="left").sweeps
        with pytest.raises(DaemonError, match="bias is 2 V; this bench allows 1 V"):
            lab.begin(build, "disk", strong, analyzer="right")
        assert lab.measure(build, "disk", strong, analyzer="left").sweeps
        with pytest.raises(DaemonError, match="analyzer 'middle' is not known; there are left, right"):
            lab.begin(build, "disk", analyzer="middle")


def test_both_measure_at_the_same_time_and_one_is_cancelled(start_daemon, build: Build, wait_until) -> None:
    start_daemon(analyzers=TWO, time_scale=5.0)
    slow = SweepPlan((Segment(1e6, 6e6, 801),), bandwidth=5)
    with connect() as lab:
        named = {name: lab.begin(build, "disk", slow, analyzer=name) for name in TWO}
        wait_until(lambda: [one.measuring for one in lab.status().analyzers] == list(named.values()))
        lab.cancel(named["right"])
        wait_until(lambda: lab.status().analyzers[1].measuring is None)
        assert lab.status().analyzers[0].measuring == named["left"]
        lab.cancel(analyzer="left")


def test_a_key_is_for_the_analyzers_that_it_names(start_daemon, build: Build, tmp_path: Path) -> None:
    make_server(keys_folder(tmp_path))
    key = tmp_path / "ana.key"
    write_secret(key, to_json(make_client(keys_folder(tmp_path), "ana", "admin", analyzers=("right",))))
    where = start_daemon(analyzers=TWO, events="tcp://0.0.0.0:*", requests="tcp://0.0.0.0:*")
    with connect(where.events, where.requests, key=key) as ana:
        assert [one.name for one in ana.hello().analyzers] == ["right"]
        with connect() as lab:
            assert lab.begin(build, "disk", analyzer="left")
        assert ana.measure(build, "disk").sweeps
        with pytest.raises(DaemonError, match="is for right; this needs one for every analyzer here, left, right"):
            ana.shutdown()
        for refused in (
            lambda: ana.begin(build, "disk", analyzer="left"),
            lambda: ana.bench({"command": "state"}, "left"),
            lambda: ana.cancel(analyzer="left"),
        ):
            with pytest.raises(DaemonError, match="the key of 'ana' is for right, not for analyzer 'left'"):
                refused()
        for path in (keys_folder(tmp_path) / "clients").glob("ana.json"):
            allowed = json.loads(path.read_text(encoding="utf-8")) | {"analyzers": ["middle"]}
            path.write_text(json.dumps(allowed), encoding="utf-8")
        time.sleep(0.05)  # the file system's time stamp
        with pytest.raises(DaemonError, match="is for none of the analyzers here, left, right"):
            ana.begin(build, "disk")


def test_an_id_of_an_earlier_run_is_not_taken_for_another_plan_or_analyzer(start_daemon, build: Build) -> None:
    def begun(points: int, analyzer: str) -> dict[str, Any]:
        plan = SweepPlan((Segment(1e6, 6e6, points),))
        words = {"build": build, "step": "disk", "plan": plan, "analyzer": analyzer}
        request = json.loads(to_json({"request": "measure", "id": "1", **words}))
        return asked(where, where.key, request)

    where = start_daemon(analyzers=TWO)
    first = begun(51, "left")["measurement"]
    with connect() as lab:
        lab.shutdown()
    where = start_daemon(analyzers=TWO)
    assert begun(51, "left")["measurement"] == first
    for points, analyzer in ((52, "left"), (51, "right")):
        assert begun(points, analyzer)["error"]["code"] == "id-in-use"


def test_clients_take_turns_in_a_queue(build: Build) -> None:
    queue = Acquisition("left", *(None,) * 5)  # type: ignore[arg-type]
    job = MeasurementJob("", build, "disk", SweepPlan((Segment(1e6, 2e6, 2),)))

    def add(*names: str, priority: int = 0) -> None:
        for name in names:
            queue.add(replace(job, measurement=name, client=name[0], priority=priority))

    add("a1", "a2", "a3", "b1", "c1", "b2", "a4")
    assert [one.measurement for one in queue.waiting] == ["a1", "b1", "c1", "a2", "b2", "a3", "a4"]
    assert [queue.waiting_of(client) for client in "abcd"] == [4, 2, 1, 0], "each has a share of its own"
    add("b0", priority=1)
    assert queue.waiting[0].measurement == "b0"


def test_settings_of_several_analyzers(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))

    def told(text: str) -> object:
        (tmp_path / "config.toml").write_text(text, encoding="utf-8")
        return options(settings({})).every_analyzer

    left = '[analyzers.left]\nresource = "TCPIP0::10.0.0.1::5025::SOCKET"\n'
    assert told(left + "[analyzers.right]\nmax_bias_V = 5\n") == {
        "left": AnalyzerOptions("TCPIP0::10.0.0.1::5025::SOCKET"),
        "right": AnalyzerOptions(max_bias_V=5),
    }
    for wrong in (left + "level = 3", '[analyzers."a\\nb"]', "[analyzers.left]\nmax_bias_V = -1", "analyzers = 3"):
        with pytest.raises(ConfigError, match=r"analyzers is .*; allowed is a table for each name"):
            told(wrong)
    for setting, says in (
        ('resource = "GPIB0::17::INSTR"', r"it is none of \[analyzers\], which are left \(TCPIP0::10.0.0.1::5025"),
        ("max_bias_V = 5", r"max_bias_V: this is the setting of a single analyzer; with \[analyzers\]"),
    ):
        with pytest.raises(ConfigError, match=says):
            told(f"{setting}\n{left}")
    assert told(f'resource = "10.0.0.1:5025"\n{left}') == told(left), "the one that is meant is chosen later"
    with pytest.raises(ConfigError, match=r"left and right are the same instrument, 10\.0\.0\.1:5025"):
        told(left + '[analyzers.right]\nresource = "10.0.0.1:5025"\n')


def test_the_command_line_names_an_analyzer(lab: Client, tmp_path: Path) -> None:
    with lab:
        right = lab.hello().analyzers[1].instrument.name

    def run(*words: str) -> str:
        return CliRunner().invoke(app, words).output

    build = tmp_path / "build.toml"
    build.write_text(THESIS_BUILD.read_text(encoding="utf-8").replace("points = 801", "points = 51"), encoding="utf-8")
    for named in (("--analyzer", "right"), ("--resource", right)):
        assert f"instrument: {right}" in run("measure", "--build", str(build), "--step", "disk", *named)
    assert "--analyzer middle: the daemon's analyzers are left, right" in str(
        CliRunner().invoke(app, ["measure", "--step", "disk", "--analyzer", "middle"]).exception
    )
    assert run("status").count("measuring: nothing; 0 waiting") == 2
