"""`pzctl measure --queue`: a file of measurements; what the journal holds is not measured again."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from command_line import run_here
from rich.console import Console

from pzctl.daemon.cli.bench.queue_run import QueueError, QueueRun
from pzctl.daemon.files.builds.build_file import THESIS_BUILD
from pzctl.daemon.files.builds.build_table import BuildError
from pzctl.daemon.files.measurement_queue import read_queue
from pzctl.daemon.samples.measurement_notes import ReaderError
from pzctl.models.build import Build

PZCTL = Path(sys.executable).with_name("pzctl")
NIGHT = """\
name = "night 1"
build = "S4.toml"

[[measure]]
sample = "X1"
step = "disk"
repeat = 2
every = "0.1s"

[[measure]]
sample = "X2"
step = "disk"
wait = "0,2 s"
sweep = { segments = [ { start_MHz = 1, stop_MHz = 6, points = 201 } ], bias_V = 2 }
measurement = { operator = "Ana" }
"""


@pytest.fixture
def night(tmp_path: Path) -> Path:
    text = THESIS_BUILD.read_text(encoding="utf-8").replace("points = 801", "points = 101")
    (tmp_path / "S4.toml").write_text(text, encoding="utf-8")
    path = tmp_path / "night.toml"
    path.write_text(NIGHT, encoding="utf-8")
    return path


def pzctl(home: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    return run_here(home, *words)


def measured(home: Path) -> dict[str, int]:
    samples = json.loads(pzctl(home, "samples", "--json").stdout)["samples"]
    return {sample["name"]: len(sample["measurements"]) for sample in samples}


def test_a_queue_is_measured_once_and_continued_where_it_grows(night: Path) -> None:
    home = night.parent
    first = pzctl(home, "measure", "--queue", "night.toml", "--time-scale", "0", "--json")
    assert first.returncode == 0, first.stderr
    report = json.loads(first.stdout)
    assert (report["queue"], [one["sample"] for one in report["measurements"]]) == ("night 1", ["X1", "X1", "X2"])
    assert measured(home) == {"X1": 2, "X2": 1}

    again = pzctl(home, "measure", "--queue", "night.toml", "--time-scale", "0")
    assert (again.returncode, again.stdout) == (1, ""), "no daemon is started"
    assert "3 of 3 measurements of queue 'night 1' are in the journal: all of them" in again.stderr

    night.write_text(NIGHT.replace("repeat = 2", "repeat = 3"), encoding="utf-8")
    more = pzctl(home, "measure", "--queue", "night.toml", "--time-scale", "0")
    assert more.returncode == 0, more.stderr
    assert "3 of 4 measurements of queue 'night 1' are in the journal; 1 is left" in more.stdout
    assert "X1, step disk, 3 of 3:" in more.stdout
    listed = [line.split() for line in pzctl(home, "samples").stdout.splitlines()]
    assert {one["id"] for one in report["measurements"]} <= {line[-1] for line in listed if line}
    assert measured(home) == {"X1": 3, "X2": 1}


@pytest.mark.skipif(sys.platform == "win32", reason="sends the signal of Ctrl-C")
def test_ctrl_c_leaves_the_rest_which_the_same_command_measures(night: Path) -> None:
    home = night.parent
    night.write_text(NIGHT.replace("0,2 s", "1 h"), encoding="utf-8")
    words = [PZCTL, "measure", "--queue", "night.toml", "--time-scale", "0"]
    environment = {**os.environ, "PZCTL_HOME": str(home), "PYTHONUNBUFFERED": "1"}
    pipe = subprocess.PIPE
    with subprocess.Popen(words, env=environment, stdout=pipe, stderr=pipe, text=True, cwd=home) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        lines: list[str] = []
        while sum("points in" in line for line in lines) < 2:
            lines.append(running.stdout.readline())
            assert lines[-1], "it ended before"
        time.sleep(0.5)  # it waits for the hour now
        running.send_signal(signal.SIGINT)
        rest = running.stdout.read()
        stopped = running.stderr.read()
    assert running.returncode == 130
    assert stopped.endswith("pzctl: stopped; kept in the journal: X1 disk (2 times)\n")
    assert "2 of 3 measured; the same command continues with the 1 that are left" in rest
    night.write_text(NIGHT, encoding="utf-8")
    assert pzctl(home, "measure", "--queue", "night.toml", "--time-scale", "0").returncode == 0
    assert measured(home) == {"X1": 2, "X2": 1}


def test_entries_have_their_own_plan_notes_and_waits(night: Path) -> None:
    queue = read_queue(night)
    first, second = queue.steps
    assert (queue.total, first.repeat, first.every, first.wait, second.wait) == (3, 2, 0.1, 0.0, 0.2)
    assert second.build.plan is not None
    assert (second.build.plan.bias_V, len(second.build.plan.segments)) == (2, 1)
    assert dict(second.build.metadata) == {"operator": "Ana", "queue": "night 1"}


def test_what_is_done_is_taken_from_the_first_entries(night: Path) -> None:
    queue = read_queue(night)
    left = queue.without({("X1", "disk"): 1, ("X9", "disk"): 5})
    assert [(entry.build.name, entry.repeat) for entry in left.steps] == [("X1", 1), ("X2", 1)]
    assert queue.without({("X1", "disk"): 2, ("X2", "disk"): 1}).total == 0


@pytest.mark.parametrize(
    ("here", "instead", "says"),
    [
        (
            'step = "disk"\nrepeat',
            'step = "disc"\nrepeat',
            "step is 'disc'; build 'thesis' has the steps disk",
        ),
        ("repeat = 2", "repeat = 0", "measure[0].repeat is 0; 1 or more is needed"),
        ('"0.1s"', '"soon"', "measure[0].every is 'soon'; a number with s, min or h is needed"),
        ('sample = "X1"', 'sample = "../X1"', "measure[0].sample is '../X1'; allowed are letters"),
        ('build = "S4.toml"\n', "", 'measure[0] has no build; write build = "S4.toml" there'),
        ("bias_V = 2", "bias_V = 2, colour = 1", "colour is not a known key"),
        ('operator = "Ana"', 'queue = "mine"', "is taken by the name of the queue"),
        ("[[measure]]", "[[measures]]", "measures is not a known key; did you mean measure?"),
        ('"S4.toml"', '"S5.toml"', "S5.toml: cannot be read"),
    ],
)
def test_a_mistake_is_one_sentence(night: Path, here: str, instead: str, says: str) -> None:
    assert here in NIGHT
    night.write_text(NIGHT.replace(here, instead), encoding="utf-8")
    with pytest.raises(BuildError) as caught:
        read_queue(night)
    assert says in str(caught.value)


def test_the_whole_queue_is_checked_before_its_first_step(night: Path) -> None:
    for what, config, says in (
        ("bias_V = 45", "", "bias is 45 V; the 4294A can do -40 to 40 V; nothing was started"),
        ("bias_V = 30", "max_bias_V = 20", "bias is 30 V; this bench allows 20 V (max_bias_V); nothing was started"),
    ):
        (night.parent / "config.toml").write_text(config, encoding="utf-8")
        night.write_text(NIGHT.replace("bias_V = 2", what), encoding="utf-8")
        done = pzctl(night.parent, "measure", "--queue", "night.toml", "--time-scale", "0")
        assert done.returncode == 2
        assert done.stderr.endswith(f"queue 'night 1': X2, step disk: sweep plan: {says}\n")
        assert "points in" not in done.stdout
    done = pzctl(night.parent, "measure", "--queue", "night.toml", "--note", "queue=mine")
    assert (done.returncode, "is taken by the name of the queue" in done.stderr) == (2, True)


def test_a_thermometer_that_fails_is_no_measurement(night: Path) -> None:
    def noted(build: Build, step: str) -> Build:
        raise ReaderError("reader 'thermometer' cannot read: unplugged")

    run = QueueRun(read_queue(night), Console(quiet=True))
    with pytest.raises(
        QueueError, match=r"3 of 3 measurements failed, the first: X1, step disk, 1 of 2: reader 'thermo"
    ):
        run.run(lambda step: None, noted, lambda entry, build: pytest.fail("measured without its notes"))


def test_options_that_the_file_replaces_are_refused(night: Path) -> None:
    done = pzctl(night.parent, "measure", "--queue", "night.toml", "--step", "disk")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    assert "--step is given beside --queue, whose file says what is measured" in done.stderr


def test_a_question_needs_a_person(night: Path) -> None:
    night.write_text(NIGHT.replace('sample = "X2"', 'sample = "X2"\nask = "X2 into the fixture"'), encoding="utf-8")
    done = pzctl(night.parent, "measure", "--queue", "night.toml")
    assert (done.returncode, "needs a person at a terminal" in done.stderr) == (2, True)


@pytest.mark.skipif(sys.platform == "win32", reason="sends the signal of Ctrl-C")
def test_ctrl_c_in_the_first_sweep_says_that_nothing_was_complete(tmp_path: Path) -> None:
    words = [PZCTL, "measure", "--step", "disk", "--time-scale", "1"]
    environment = {**os.environ, "PZCTL_HOME": str(tmp_path), "PYTHONUNBUFFERED": "1"}
    pipe = subprocess.PIPE
    with subprocess.Popen(words, env=environment, stdout=pipe, stderr=pipe, text=True, cwd=tmp_path) as running:
        assert running.stdout is not None
        assert running.stderr is not None
        while "instrument:" not in (line := running.stdout.readline()):
            assert line, "it ended before"
        time.sleep(1)  # it sweeps now
        running.send_signal(signal.SIGINT)
        running.stdout.read()
        stopped = running.stderr.read()
    assert running.returncode == 130
    assert stopped.endswith("pzctl: stopped; no measurement was complete\n")
