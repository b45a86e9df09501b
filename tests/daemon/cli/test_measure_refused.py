"""`pzctl measure` where the simulated bench refuses: one step only, or every step alike."""

import json
from collections.abc import Callable
from pathlib import Path

import pytest
from command_line import run_here

from pzctl.daemon.client.client import Client, connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.builds.build_file import THESIS_BUILD
from pzctl.daemon.files.paths import home
from pzctl.models.build import Build
from pzctl.models.sweep_plan import Segment, SweepPlan

OVER = "bench: the device is at step 'ml1' and glue does not come off, so 'disk' is over"


@pytest.fixture
def at_ml1(tmp_path: Path, start_daemon: Callable[..., Location]) -> Path:
    """The folder of a daemon whose bench holds a device with its first matching layer."""
    start_daemon()
    with connect() as lab:
        lab.bench({"command": "step", "name": "ml1"})
    text = THESIS_BUILD.read_text(encoding="utf-8").replace("points = 801", "points = 21")
    (tmp_path / "S4.toml").write_text(text, encoding="utf-8")
    return tmp_path


def kept(lab: Client) -> list[tuple[str, str]]:
    return [(sample.name, one.step) for sample in lab.samples() for one in sample.measurements]


def test_a_step_that_is_over_is_told_at_the_end_and_the_others_are_measured(at_ml1: Path) -> None:
    done = run_here(at_ml1, "measure", "--build", "S4.toml", "--json")
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1].startswith(f"pzctl: not measured: step disk; {OVER}")
    report = json.loads(done.stdout)
    assert [one["step"] for one in report["measurements"]] == ["ml1", "ml2"]
    assert [one["step"] for one in report["refused"]] == ["disk"]
    with connect() as lab:
        assert [step for _, step in kept(lab)] == ["ml1", "ml2"]


def test_a_queue_goes_on_after_a_step_that_is_over(at_ml1: Path) -> None:
    entries = [f'[[measure]]\nsample = "{name}"\nstep = "{step}"\n' for name, step in (("X1", "disk"), ("X2", "ml1"))]
    (at_ml1 / "night.toml").write_text("\n".join(['name = "n"\nbuild = "S4.toml"\n', *entries]), encoding="utf-8")
    done = run_here(at_ml1, "measure", "--queue", "night.toml")
    assert done.returncode == 1
    assert f"1 of 2 measurements failed, the first: X1, step disk: {OVER}" in done.stderr
    with connect() as lab:
        assert kept(lab) == [("X2", "ml1")]


def test_what_every_step_would_meet_ends_the_run_with_one_sentence(
    build: Build, start_daemon: Callable[..., Location]
) -> None:
    start_daemon(time_scale=1.0)
    with connect() as lab:
        lab.bench({"command": "step", "name": "disk"})
        running = lab.begin(build, "disk", SweepPlan(tuple(Segment(1e6, 6e6, 801) for _ in range(20))))
        done = run_here(home(), "measure", "--step", "ml1", "--json")
        assert (done.returncode, done.stdout) == (2, "")
        assert done.stderr.endswith("\npzctl: bench: no gluing while a measurement runs or waits; ask again later\n")
        assert lab.status().queue == ()
        lab.cancel(running)
