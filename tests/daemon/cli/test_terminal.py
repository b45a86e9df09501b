"""The command line in a terminal: help with examples, quiet, JSON, colours by tolerance, completion, exit codes."""

import io
import os
import re
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rich.console import Console
from typer.testing import CliRunner

from pzctl.daemon.cli.commands import app
from pzctl.daemon.cli.lab import keys_commands as keys_room
from pzctl.daemon.cli.records import journal_commands as journal_room
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.daemon.report import terminal
from pzctl.daemon.report.tables.deviation import deviation, shift_text
from pzctl.daemon.report.tables.fit_tables import fit_table, print_fit
from pzctl.daemon.report.terminal import be_quiet, console
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import Constant, FitResult, FitTask, Noise
from pzctl.fitters.layered.mason import Mason
from pzctl.models.base.uncertain_numbers import with_uncertainty
from pzctl.models.build import Build, LayerSpec, Quantity
from pzctl.models.sweep import Sweep

ROOMS = {(): app, ("journal",): journal_room.app, ("keys",): keys_room.app}
COMMANDS = [
    (*prefix, str(one.name)) for prefix, room in ROOMS.items() for one in room.registered_commands if not one.hidden
]
SERVING = {"daemon", "sim"}
"""They have no --json: the one logs as JSON if asked, the other always prints its addresses as JSON."""


@pytest.mark.parametrize("words", COMMANDS, ids=" ".join)
def test_every_command_has_an_example_a_quiet_mode_and_json_output(words: tuple[str, ...]) -> None:
    shown = CliRunner().invoke(app, [*words, "--help"], env={"COLUMNS": "200"})
    assert shown.exit_code == 0
    assert f"pzctl {' '.join(words)}" in shown.output.split("Example", 1)[1]
    assert "--quiet" in shown.output
    assert ("--json" in shown.output) == (" ".join(words) not in SERVING)


def test_quiet_does_not_change_standard_output() -> None:
    be_quiet(True)
    assert console(stderr=True).quiet
    assert not console().quiet
    be_quiet(False)
    assert not console(stderr=True).quiet


def test_what_takes_long_is_told_in_a_pipe(
    monkeypatch: pytest.MonkeyPatch, wait_until: Callable[[Callable[[], object]], None]
) -> None:
    monkeypatch.setattr(terminal, "_FIRST", 1e-3)
    pipe = console(stderr=True)
    pipe.file = io.StringIO()
    with pipe.status("disk2d") as status:
        status.update("disk2d: fitting [red]disk")
        wait_until(lambda: "disk2d: fitting [red]disk (0 s)\n" in pipe.file.getvalue())  # type: ignore[attr-defined]


@pytest.mark.parametrize(
    ("value", "u", "written"),
    [
        (1.514e11, 3e8, "1.514(3)e11"),
        (1.5144e11, 1.2e8, "1.5144(12)e11"),
        (5.1198e-4, 9.998e-7, "5.120(10)e-4"),
        (2455.0, 150.0, "2455(150)"),
        (2455.0, 154.3, "2455(150)"),
        (1641.0, 22214.0, "0(2)e4"),
        (7694.0, 1520.0, "7.7(15)e3"),
        (0.0, 2e-3, "0.000(2)"),
        (7700.0, 0.0, "7700"),
        (2.8e6, 0.0, "2.8e6"),
        (-1.25e-10, None, "-1.25e-10"),
        (float("nan"), 1.0, "-"),
        (2.6881171418161353692e43, 7e-27, "2.68812e43"),  # beyond the precision of a double
        (1.0, 5e-324, "1"),
    ],
)
def test_numbers_are_formatted_with_their_uncertainty(value: float, u: float | None, written: str) -> None:
    assert with_uncertainty(value, u) == written


@pytest.mark.parametrize(
    ("re", "words", "verdict"),
    [
        (101.0, "+1.0 % (0.7 u)", "near"),
        (1e45, "+1.0e+45 % (7.1e+44 u)", "far"),
        (102.0, "+2.0 % (1.4 u)", "off"),
        (104.0, "+4.0 % (2.8 u)", "far"),
    ],
)
def test_a_deviation_counts_in_uncertainties_of_both(re: float, words: str, verdict: str) -> None:
    constant = Constant(re, 0.0, 1.0, 0.0, "m")
    assert deviation("ml1.thickness", constant, Quantity(100.0, u=1.0)) == (words, verdict)


def test_a_shift_of_what_is_zero_within_its_uncertainty_counts_in_uncertainties() -> None:
    constants = {"disk.h33": {"re": 2e9, "u_re": 1e7, "im": 1e3, "u_im": 1e5}}
    assert shift_text("disk.h33", -0.004, constants) == "disk.h33 -0.4 %"
    assert shift_text("disk.h33.im", 110.0, constants) == "disk.h33.im +1.1 u"
    assert shift_text("disk.kt", 0.02, constants) == "disk.kt +2 %"


def drawn(build: Build, colours: bool) -> str:
    constants = {f"a.{k}": Constant(100.0 + k, 0.0, 1.0, 0.0, "m") for k in (1, 2, 4)}
    noise = Noise(1e-4, "repeats")
    result = FitResult("B", "mason", "1", ("disk",), noise, 1.0, constants, {}, (), 1e-4, True, 1, 0.1)
    paper = io.StringIO()
    system: Any = "standard" if colours else "auto"
    Console(file=paper, force_terminal=colours, width=120, color_system=system).print(fit_table(result, build))
    return paper.getvalue()


def test_the_table_is_coloured_by_tolerance_only_in_a_terminal() -> None:
    air = Quantity(1.0)
    values = {str(k): Quantity(100.0, u=1.0) for k in (1, 2, 4)}
    layer = LayerSpec("a", "elastic", values)
    build = Build("B", air, (layer,), None, None, ())  # type: ignore[arg-type]
    coloured = drawn(build, colours=True)
    for sign, part in (("32", "+1.0 %"), ("33", "+2.0 %"), ("1;31", "+4.0 %")):
        assert f"\x1b[{sign}m{part}" in coloured
    assert "\x1b" not in drawn(build, colours=False)


def test_a_constant_is_listed_once_in_any_order_of_the_constants() -> None:
    names = ("disk.c33E", "area", "disk.thickness", "glue1.z")
    constants = {name: Constant(1.0, 0.0, 0.1, 0.0, "1") for name in names}
    derived = {"disk.kt": Constant(0.48, 0.0, 0.01, 0.0, "1")}
    noise = Noise(1e-4, "repeats")
    result = FitResult("B", "disk2d", "1", ("disk",), noise, 1.0, constants, derived, (), 1e-4, True, 1, 0.1)
    names = fit_table(result, None).column(0)
    assert [name.strip() for name in names] == ["disk.c33E", "disk.thickness", "disk.kt", "area", "glue1.z"]


PZCTL = Path(sys.executable).with_name("pzctl")


@pytest.mark.skipif(sys.platform == "win32", reason="bash completes here")
def test_the_shell_completes_commands() -> None:
    environment = {**os.environ, "_PZCTL_COMPLETE": "complete_bash", "COMP_WORDS": "pzctl mea", "COMP_CWORD": "1"}
    done = subprocess.run([PZCTL], env=environment, capture_output=True, text=True, check=False)
    assert done.stdout.split() == ["measure"]


@pytest.mark.parametrize(
    ("words", "status"),
    [
        (["fitters", "--json"], 0),
        (["--version"], 0),
        (["samples"], 1),
        (["fit", "x"], 2),
        (["no-such"], 2),
        (["effects", "no-such"], 2),
    ],
)
def test_exit_status(words: list[str], status: int, tmp_path: Path) -> None:
    environment = {**os.environ, "PZCTL_HOME": str(tmp_path)}
    done = subprocess.run([PZCTL, *words], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == status
    assert "Traceback" not in done.stderr
    assert bool(done.stderr) == bool(status)


def test_ctrl_c_while_the_commands_are_imported_is_no_traceback(tmp_path: Path) -> None:
    interrupted = "import signal, time; signal.raise_signal(signal.SIGINT); time.sleep(60)"
    (tmp_path / "typer.py").write_text(interrupted, encoding="utf-8")
    path = os.pathsep.join([str(tmp_path), *filter(None, [os.environ.get("PYTHONPATH")])])
    done = subprocess.run(
        [sys.executable, "-c", "from pzctl.daemon.cli import main; main()", "materials"],
        env={**os.environ, "PYTHONPATH": path},
        capture_output=True,
        text=True,
        check=False,
    )
    assert (done.returncode, done.stdout, done.stderr) == (130, "", "pzctl: stopped\n")


def test_a_picture_of_the_terminal_for_the_guides(tmp_path: Path) -> None:
    """PZCTL_SCREENSHOTS names a folder to keep it in: see `make pictures`."""
    build = read_build(THESIS_BUILD)
    rng = np.random.default_rng(0)
    f = np.linspace(1e6, 15e6, 801)
    noise = 3e-5 * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
    sweep = Sweep(f, stack_of(build, build.steps[0]).impedance(f) * np.exp(noise))
    paper = Console(record=True, file=io.StringIO(), width=112, force_terminal=True, color_system="truecolor")
    print_fit(paper, Mason().fit(FitTask(build, {"disk": (sweep,)})), build)
    svg = re.sub(r"@font-face \{.*?\}", "", paper.export_svg(title="pzctl show thesis --step disk"), flags=re.DOTALL)
    assert "c33D" in svg
    assert "url(http" not in svg, "nothing from outside"
    folder = Path(os.environ.get("PZCTL_SCREENSHOTS", tmp_path))
    (folder / "terminal-fit.svg").write_text(svg, encoding="utf-8")


def test_a_quiet_daemon_says_nothing_when_all_is_well(
    tmp_path: Path, wait_until: Callable[[Callable[[], object]], None]
) -> None:
    environment = {**os.environ, "PZCTL_HOME": str(tmp_path)}
    words = [PZCTL, "daemon", "--quiet", "--time-scale", "0"]
    with subprocess.Popen(words, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as daemon:
        wait_until(lambda: (tmp_path / "daemon.json").exists() or daemon.poll() is not None)
        stopped = subprocess.run([PZCTL, "daemon", "--stop"], env=environment, capture_output=True, check=False)
        assert stopped.returncode == 0
        assert daemon.communicate(timeout=60) == ("", "")
