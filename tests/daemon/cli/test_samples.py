"""`pzctl samples` and `pzctl fit --all` with the real command, journal, daemon and processes."""

import json
import math
import os
import signal
import subprocess
import sys
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run_here

from pzctl.daemon.cli import main
from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.report.tables.joint_output import _analyzer
from pzctl.daemon.report.tables.population_table import _sheet, population_table
from pzctl.daemon.samples.sample_selection import by_number, folder_samples, journal_samples, sheets_of, step_of
from pzctl.daemon.wire.events import FitEvent, InstrumentInfo, SampleStep, StateEvent, SweepEvent, decode, sweep_columns
from pzctl.drivers.recordings import write_csv
from pzctl.fitters.interface import Constant, FitResult, Noise
from pzctl.fitters.population.population_statistics import DataSheet, population
from pzctl.fitters.population.shared_bench import SharedBench
from pzctl.models.build import Build
from pzctl.models.stack import Elastic, HalfSpace, Piezo, Stack
from pzctl.models.sweep import Sweep

PZCTL = Path(sys.executable).with_name("pzctl")
BUILD = """
name = "{name}"
diameter_mm = 16.0
[[layers]]
name = "disk"
kind = "piezo"
material = "Pz27"
thickness_mm = {{ value = 0.512, u = 0.001 }}
[[layers]]
name = "ml1"
kind = "elastic"
z_MRayl = {{ value = 10.3, u = 0.5 }}
c_m_s = {{ value = 2455, u = 150 }}
q = {{ value = 60, u = 30 }}
thickness_mm = {{ value = 0.139, u = 0.001 }}
[load]
back = "air"
front = "air"
[[steps]]
name = "disk"
layers = ["disk"]
[[steps]]
name = "ml1"
layers = ["disk", "ml1"]
"""


def build(name: str) -> Build:
    return parse_build(BUILD.format(name=name))


def sweep(step: str, c33D: float, seed: int) -> Sweep:
    """A recording of a sample with this stiffness, with relative noise of 1e-3."""
    disk = Piezo("disk", 5.12e-4, 7700, c33D * (1 + 0.011j), 1.95e9, 8.1e-9 * (1 - 0.016j))
    layers = (disk,) if step == "disk" else (disk, Elastic("ml1", 1.39e-4, 10.5e6, 2500.0, 50.0))
    air = HalfSpace("air", 413.0)
    f = np.linspace(1.5e6, 8e6, 301)
    z = Stack(layers, air, air, math.pi * 0.008**2).impedance(f)
    noise = np.random.default_rng(seed).standard_normal((2, f.size))
    return Sweep(f, z * (1 + 1e-3 * (noise[0] + 1j * noise[1])), id=f"{step}-{seed}")


def put(journal: JournalWriter, name: str, step: str, recorded: Sweep) -> str:
    """Put a complete measurement into the journal, as the daemon does."""
    measured = build(name)
    measurement, _ = journal.begin_measurement(f"{name}-{step}-{recorded.id}", measured, step)
    columns, payload = sweep_columns(recorded)
    said = SweepEvent(
        measurement=measurement,
        sample=SampleStep(name, step),
        instrument=InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True),
        build=measured,
        segment=1,
        segments=1,
        started=recorded.time,
        settings={},
        columns=columns,
    )
    journal.append(said, payload)
    journal.append(StateEvent(state="measured", measurement=measurement, sample=SampleStep(name, step)))
    return measurement


STIFFNESS = {"S1": 1.48e11, "S2": 1.50e11, "S3": 1.53e11}


def fill(home: Path) -> None:
    """Three samples; S1 measured twice, first badly; S2 with a matching layer; one that is a resistor."""
    journal = JournalWriter(home / "journal")
    put(journal, "S1", "disk", sweep("disk", 1.0e11, 9))
    for k, (name, c33D) in enumerate(STIFFNESS.items()):
        put(journal, name, "disk", sweep("disk", c33D, k))
    put(journal, "S2", "ml1", sweep("ml1", STIFFNESS["S2"], 5))
    f = np.linspace(1e6, 2e6, 51)
    put(journal, "short", "disk", Sweep(f, np.full(51, 50.0 + 0j)))
    journal.close()


def pzctl(*words: str, home: Path) -> "subprocess.CompletedProcess[str]":
    return run_here(home, *words, environment={"COLUMNS": "120"})


@pytest.fixture
def here(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> Callable[..., tuple[object, str, str]]:
    """Return a function that runs the command line in this process: exit status, standard output, standard error."""
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))

    def run(*words: str) -> tuple[object, str, str]:
        monkeypatch.setattr(sys, "argv", ["pzctl", *words])
        with pytest.raises(SystemExit) as ended:
            main()
        return (ended.value.code, *capsys.readouterr())

    return run


def check_population(found: dict[str, Any]) -> None:
    assert found["samples"] == ["S1", "S2", "S3"]
    part = found["constants"]["disk.c33D"]["re"]
    assert part["n"] == 3
    assert part["mean"] == pytest.approx(np.mean(list(STIFFNESS.values())), rel=3e-3)
    assert part["sd"] == pytest.approx(np.std(list(STIFFNESS.values()), ddof=1), rel=0.3)
    assert part["effects"]["tau_low"] <= part["effects"]["tau"] <= part["sd"]
    assert part["sheet"]["nominal"] == pytest.approx(144.4e9)
    assert found["constants"]["ml1.z"]["re"]["n"] == 1


Run = Callable[..., tuple[object, str, str]]


def test_the_journal_is_refitted_kept_and_listed(tmp_path: Path, here: Run) -> None:
    fill(tmp_path)
    status, _, errors = here("samples", "--constants")
    assert status == 1
    assert "holds no fit by 'mason'; `pzctl fit --all --fitter mason` makes them" in errors
    done = pzctl("fit", "--all", "--json", home=tmp_path)
    assert done.returncode == 1
    assert done.stderr.splitlines()[-1] == "pzctl: 1 of 4 fits failed: short; see above"
    answer = json.loads(done.stdout)
    assert list(answer["fits"]) == ["S1", "S2", "S3"]
    assert answer["fits"]["S2"]["steps"] == ["disk", "ml1"]
    assert answer["failed"].keys() == {"short"}
    check_population(answer["population"])
    listed = json.loads(here("samples", "--constants", "--json")[1])
    assert listed["constants"] == answer["population"]["constants"], "the journal says the same"
    of_disk = json.loads(here("samples", "--constants", "--json", "--step", "disk")[1])
    assert of_disk["samples"] == ["S1", "S3"], "S2 was fitted with its matching layer"
    table = here("samples", "--constants")[1]
    assert max(map(len, table.splitlines())) <= 120
    assert "…" not in table


def test_while_a_daemon_runs_it_keeps_the_results_once(
    tmp_path: Path, start_daemon: Callable[..., object], here: Run
) -> None:
    fill(tmp_path)
    start_daemon()
    for _ in range(2):
        done = pzctl("fit", "--all", home=tmp_path)
        assert done.returncode == 1, done.stderr
        assert "not kept" not in done.stderr
    check_population(json.loads(here("samples", "--constants", "--json")[1]))
    archive = JournalReader(tmp_path / "journal")
    kept = [decode(frames).event for frames in archive.replay(1, None, 1000)]
    archive.close()
    assert sum(isinstance(event, FitEvent) for event in kept) == 3


def test_samples_lists_steps_times_and_fits(tmp_path: Path, here: Run) -> None:
    fill(tmp_path)
    answer = json.loads(here("samples", "--json")[1])
    assert [one["name"] for one in answer["samples"]] == ["S1", "S2", "S3", "short"]
    assert [one["step"] for one in answer["samples"][1]["measurements"]] == ["disk", "ml1"]
    assert {"sample", "step", "measured", "fits", "S1", "S2", "disk", "ml1"} <= set(here("samples")[1].split())


def test_the_latest_measurement_of_each_step_is_taken(tmp_path: Path) -> None:
    fill(tmp_path)
    archive = JournalReader(tmp_path / "journal")
    found = {sample.name: sample for sample in journal_samples(archive)}
    archive.close()
    job = found["S1"].job
    assert job is not None
    assert np.array_equal(job.task.sweeps["disk"][0].impedance, sweep("disk", STIFFNESS["S1"], 0).impedance)


def put_folder(folder: Path, name: str, c33D: float, seed: int) -> Path:
    (folder / name).mkdir(parents=True)
    (folder / name / "build.toml").write_text(BUILD.format(name="the same name in each"))
    write_csv(sweep("disk", c33D, seed), folder / name / "disk.csv")
    return folder / name


def test_a_folder_of_samples_and_one_that_cannot_be_read(tmp_path: Path) -> None:
    folder = tmp_path / "lab"
    for k, (name, c33D) in enumerate(STIFFNESS.items()):
        put_folder(folder, name, c33D, k)
    write_csv(sweep("disk", STIFFNESS["S1"], 7), folder / "S1" / "disk-2.csv")
    (folder / "S3" / "readme.txt").write_text("bench 2")
    (folder / "notes").mkdir()
    (put_folder(folder, "bad", 1.5e11, 8) / "build.toml").write_text("name = 3")
    done = pzctl("fit", "--all", str(folder), "--json", home=tmp_path)
    assert done.returncode == 1
    assert "readme.txt: its name begins with none of the steps disk, ml1; it is left out" in done.stderr
    answer = json.loads(done.stdout)
    assert list(answer["fits"]) == ["S1", "S2", "S3"]
    assert "build.toml" in answer["failed"]["bad"]
    assert answer["fits"]["S1"]["noise"]["from"] == "repeats"
    assert not (tmp_path / "journal").exists()


@pytest.mark.parametrize(
    ("stem", "step"),
    [
        *(("ml1", "ml1"), ("ml1-2", "ml1"), ("ml1 run b", "ml1"), ("ml12", None), ("ml10", "ml10"), ("disk2", "disk")),
        *(("diskette", None), ("disk_glued", "disk_glued"), ("disk_glue", "disk"), ("other", None)),
    ],
)
def test_the_step_of_a_file(stem: str, step: str | None) -> None:
    assert step_of(stem, ["disk", "disk_glued", "ml1", "ml10"]) == step


def test_the_sweeps_of_a_step_are_in_the_order_of_their_numbers(tmp_path: Path) -> None:
    """A drift goes on from one sweep to the next."""
    (tmp_path / "S1").mkdir()
    (tmp_path / "S1" / "build.toml").write_text(BUILD.format(name="S1"))
    names = ["disk.csv", "disk-2.csv", "disk-10.csv"]
    for name in names:
        (tmp_path / "S1" / name).write_text("frequency_Hz,R_ohm,X_ohm\n1e6,1,-50\n2e6,1,-25\n3e6,1,-16\n")
    (sample,) = folder_samples(tmp_path)
    assert sample.job is not None
    assert [sweep.id for sweep in sample.job.task.sweeps["disk"]] == names


@pytest.mark.parametrize(
    ("given", "taken"),
    [
        (["disk-10.csv", "disk-2.csv", "disk.csv"], ["disk.csv", "disk-2.csv", "disk-10.csv"]),
        (["ml1_2.csv", "ml1.csv"], ["ml1.csv", "ml1_2.csv"]),
        (["up.csv", "down.csv"], ["up.csv", "down.csv"]),
        (["b-1.csv", "a-2.csv"], ["b-1.csv", "a-2.csv"]),
    ],
)
def test_files_that_differ_in_a_number_only_are_taken_in_its_order(given: list[str], taken: list[str]) -> None:
    assert by_number([Path(name) for name in given]) == [Path(name) for name in taken]


def test_a_folder_without_recordings_is_reported(tmp_path: Path) -> None:
    (tmp_path / "S1").mkdir()
    (tmp_path / "S1" / "build.toml").write_text(BUILD.format(name="S1"))
    (sample,) = folder_samples(tmp_path)
    assert sample.job is None
    assert "no recording; files named after the steps are needed: disk.csv, ml1.csv" in (sample.error or "")


def test_the_data_sheet_values_are_those_common_to_all_builds() -> None:
    one, other = build("a"), parse_build(BUILD.format(name="b").replace("0.512", "0.530"))
    sheets = sheets_of((one, other))
    assert sheets["disk.c33D"].re == pytest.approx(144.4e9)
    assert "disk.thickness" not in sheets


def test_the_table_shows_a_row_for_each_part() -> None:
    fit = FitResult("S", "f", "1", ("disk",), Noise(1e-3, "repeats"), 1.0, {}, {}, (), 0.01, True, 1, 0.1)
    values = (Constant(1.5e11 + k * 1e9, 1.6e9, 2e8, 1e7, "Pa") for k in range(3))
    fits = {f"S{k}": replace(fit, constants={"disk.c33D": value}) for k, value in enumerate(values)}
    table = population_table(population(fits, sheets_of([build("S")])))
    cells = [table.column(k) for k in range(len(table.columns))]
    assert cells[0] == ["disk.c33D re, Pa", "disk.c33D im, Pa"]
    assert [cell[0] for cell in cells[1:]] == [
        "3",
        "1.51e11",
        "1e18",
        "1e9",
        "9.8 (4.8..62.8)e8",
        "2e8",
        "+4.6 % of ±10 %",
    ]
    assert [cell[1] for cell in cells[4:6]] == ["0", "0"]


def test_what_does_not_show_is_not_told_as_zero_per_cent() -> None:
    assert _sheet(DataSheet(1e-3, 1e-9, 1e-9, ())) == "none"
    assert _sheet(DataSheet(1e-3, 0.0, 2e-5, ())) == "+0.0 % of ±2.0 %"
    bench = SharedBench((), (), {}, 0.0, 0.0, {}, ())
    assert _analyzer(bench) == "The samples show no common error of the analyzer."
    assert "gain 0.01 %, phase 0 mrad at most" in _analyzer(replace(bench, gain=1e-4))


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["fit"], "no recording is given; STEP=FILE is needed, or --all"),
        (["fit", "--dask", "tcp://127.0.0.1:1", "disk=a.csv"], "--dask needs --all"),
        (["fit", "--jobs", "2", "disk=a.csv"], "--jobs needs --all"),
        (
            ["fit", "--all", "--jobs", "2", "--dask", "tcp://127.0.0.1:1"],
            "--jobs does not go with --dask: its workers are the processes",
        ),
        (
            ["fit", "--accuracy", "50", "disk=a.csv"],
            "--accuracy is '50'; a number from 0.0001 to 10, in per cent of |Z|, is allowed",
        ),
        (
            ["diagnose", "--accuracy", "good", "disk=a.csv"],
            "--accuracy is 'good'; a number from 0.0001 to 10, in per cent of |Z|, is allowed",
        ),
        (["fit", "--all", "disk=a.csv"], "--all takes one folder, or nothing for the journal; found disk=a.csv"),
        (["fit", "--all", "--build", "b.toml"], "--build does not go with --all: each sample has its own"),
        (["fit", "--all"], "nothing was measured yet; begin with `pzctl measure`"),
        (["fit", "--all", "nowhere"], "nowhere: no such folder"),
        (["diagnose"], "no recording is given; STEP=FILE is needed, or --all"),
        (["diagnose", "--dask", "", "disk=a.csv"], "--dask needs --all"),
        (["diagnose", "nowhere"], "nowhere: no such folder; one of samples is needed, or STEP=FILE"),
        (["diagnose", "."], "no subfolder holds a build.toml"),
        (["diagnose", ".", "b"], ". is a folder; STEP=FILE is needed, or nothing but one folder of samples"),
        (
            ["diagnose", "disk=a.csv"],
            "no build is given; --build is needed, or --fitter bvd for an unknown device",
        ),
        (["samples"], "nothing was measured yet; begin with `pzctl measure`"),
        (["samples", "--step", "disk"], "--step needs --constants"),
    ],
)
def test_wrong_usage_is_one_sentence(words: Sequence[str], sentence: str, here: Run) -> None:
    status, output, errors = here(*words)
    assert status in (1, 2)
    assert output == ""
    assert errors.startswith("pzctl: ")
    assert sentence in errors
    assert len(errors.splitlines()) == 1


SLOW = """
import os, pathlib, time
class Slow:
    name, version, summary = "slow", "1", "never ends"
    def fit(self, task, progress=None):
        part = pathlib.Path(__file__).with_name(task.build.name + ".part")
        part.write_text(str(os.getpid()))
        part.replace(part.with_suffix(".begun"))
        time.sleep(600)
"""


COUNTED = """
import os, pathlib, time
class Slow:
    name, version, summary = "slow", "1", "tells its process"
    def fit(self, task, progress=None):
        time.sleep(1)
        raise RuntimeError(f"process {os.getpid()}")
"""


def with_fitter(folder: Path, code: str) -> dict[str, str]:
    """Install the fitter `slow` in a folder; return the environment in which it is found."""
    (folder / "slow_fitter.py").write_text(code)
    info = folder / "slow_fitter-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: slow-fitter\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[pzctl.fitters]\nslow = slow_fitter:Slow\n")
    path = os.pathsep.join(filter(None, [str(folder), os.environ.get("PYTHONPATH")]))
    return {**os.environ, "PZCTL_HOME": str(folder), "PYTHONPATH": path}


@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="one core has one process anyway")
def test_a_batch_has_as_many_processes_as_it_is_told(tmp_path: Path) -> None:
    fill(tmp_path)
    environment = with_fitter(tmp_path, COUNTED)

    def processes(*options: str) -> set[str]:
        words = [PZCTL, "fit", "--all", "--fitter", "slow", *options]
        ended = subprocess.run(words, env=environment, capture_output=True, text=True, check=False)
        return {line.rpartition(" ")[2] for line in ended.stderr.splitlines() if "process" in line}

    assert len(processes("--jobs", "1")) == 1
    assert len(processes()) > 1


@pytest.mark.skipif(os.name == "nt", reason="process groups are POSIX")
def test_ctrl_c_ends_a_batch_cleanly(
    tmp_path: Path,
    wait_until: Callable[[Callable[[], object]], None],
    start_program: "Callable[..., subprocess.Popen[str]]",
) -> None:
    fill(tmp_path)
    environment = with_fitter(tmp_path, SLOW)
    process = start_program(
        [PZCTL, "fit", "--all", "--fitter", "slow"],
        env=environment,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    processes = min(len(STIFFNESS), os.cpu_count() or 1)
    wait_until(lambda: len(list(tmp_path.glob("*.begun"))) >= processes)
    os.killpg(process.pid, signal.SIGINT)
    output, errors = process.communicate(timeout=120)
    assert (process.returncode, output) == (130, "")
    assert errors in ("", "pzctl: stopped\n")
    for begun in tmp_path.glob("*.begun"):
        with pytest.raises(ProcessLookupError):
            os.kill(int(begun.read_text()), 0)
