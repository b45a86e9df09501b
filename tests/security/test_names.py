"""A name is shown as plain text everywhere: it cannot inject markup, terminal escape sequences or new lines."""

import io
import json
import logging
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import zmq
from keyed import unlocked

from pzctl.daemon.cli import main
from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.builds.build_file import BuildError, build_from_json, build_to_json
from pzctl.daemon.files.config import ConfigError, settings
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.report.pictures.fit_pictures import fit_picture
from pzctl.daemon.report.pictures.svg_pictures import circle_svg, correlation_svg, curves_svg, history_svg
from pzctl.daemon.server.logs import TextLines
from pzctl.daemon.wire.events import SampleStep, StateEvent
from pzctl.fitters.interface import Constant, Curve, FitResult, Noise
from pzctl.models.base.names import LONGEST_NAME, as_file_name
from pzctl.models.build import Build

ESCAPE = "\x1b[2J"
BAD = ["a" + ESCAPE, "a\nmeasured: S5", "a\x00b", "a\u202eb", " a", "", "a" * (LONGEST_NAME + 1)]
"""Invalid names: an escape sequence, a second line, NUL, right-to-left text, blanks, an empty and an endless name."""


def test_the_wire_takes_no_such_name(start_daemon: Callable[..., Location], build: Build) -> None:
    where = start_daemon()
    with connect() as lab:
        for name in BAD:
            bad_step = replace(build.steps[1], name=name)
            for refused in (replace(build, name=name), replace(build, steps=(build.steps[0], bad_step))):
                with pytest.raises(DaemonError, match="request: name of"):
                    lab.begin(refused, "disk")
        assert lab.samples() == ()
    with zmq.Context() as context, context.socket(zmq.REQ) as link:
        unlocked(link, where).connect(where.requests)
        for name in BAD:
            for request in (
                {"request": "hello", "fitter": name, "version": "1"},
                {"request": "submit", "fitter": name, "version": "1", "measurement": "m", "sweeps": [], "error": "x"},
                *([] if len(name) == LONGEST_NAME + 1 else [{"request": "lease", "owner": name, "seconds": 1.0}]),
            ):
                link.send(json.dumps({"id": "1", **request}).encode())
                assert link.poll(20_000)
                assert json.loads(link.recv())["error"]["code"] == "bad-request", request


@pytest.mark.parametrize("name", BAD, ids=ascii)
def test_neither_a_build_nor_a_setting_has_such_a_name(build: Build, name: str) -> None:
    with pytest.raises(BuildError):
        build_from_json(build_to_json(replace(build, name=name)))
    if name.strip():
        with pytest.raises(ConfigError):
            settings({"station": name})


def old_journal(home: Path, build: Build, name: str) -> None:
    """Write a journal like those of an earlier version, which accepted every name."""
    (home / "journal").mkdir()
    journal = JournalWriter(journal_folder(home))
    odd = replace(build, name=name, steps=(replace(build.steps[0], name=name),))
    measurement, _ = journal.begin_measurement("1", odd, name)
    journal.append(StateEvent(state="measured", measurement=measurement, sample=SampleStep(name, name)))
    journal.close()


@pytest.mark.parametrize("command", [["samples"], ["show"]], ids=" ".join)
@pytest.mark.parametrize("name", ["[/red]", "[red]S4", ":smile:", "S4" + ESCAPE, "S4\nS5"], ids=ascii)
def test_an_old_journal_with_such_names_is_shown(
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    build: Build,
    command: list[str],
    name: str,
) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    old_journal(tmp_path, build, name)
    monkeypatch.setattr("sys.argv", ["pzctl", *command, *([name] if command == ["show"] else [])])
    with pytest.raises(SystemExit) as ended:
        main()
    printed = capsys.readouterr().out
    assert ended.value.code in (0, None)
    assert ascii(name)[1:-1] in printed
    assert ESCAPE not in printed


def test_a_name_is_not_a_formula_in_a_picture(tmp_path: Path) -> None:
    f, z = np.linspace(1e6, 2e6, 11), np.full(11, 50 - 10j)
    odd = "$\\x$" + ESCAPE
    constants = {f"{odd}.{name}": Constant(1.0, 0.0, 0.1, None, odd) for name in ("c", "z")}
    fit = FitResult(
        build=odd,
        fitter=odd,
        version="1",
        steps=(odd,),
        noise=Noise(1e-3, "smoothness"),
        chi2_per_dof=1.0,
        constants=constants,
        derived={},
        correlation=((*constants, 0.9),),
        rms_log_error=0.1,
        converged=True,
        evaluations=1,
        seconds=0.1,
        curves=(Curve(odd, f, z, z, z),),
    )
    assert fit_picture(fit, tmp_path / "fit.png").exists()
    assert curves_svg(fit.curves, 1e-3)
    assert circle_svg(fit.curves)
    assert correlation_svg(fit.correlation)
    assert history_svg({name: [(odd, one)] for name, one in constants.items()})


def test_no_file_name_leads_out_of_its_folder() -> None:
    assert as_file_name("../../S4", "a\\b\n", "x" + ESCAPE) == "_.._S4-a_b_-x__2J"
    assert as_file_name("S4.a", "ml1 (2)", "mason") == "S4.a-ml1 _2_-mason"


def test_a_log_message_stays_on_one_line() -> None:
    stream = io.StringIO()
    handler = logging.StreamHandler(stream)
    handler.setFormatter(TextLines("%(levelname)s %(message)s"))
    handler.emit(logging.makeLogRecord({"levelname": "INFO", "msg": f"a\n12:00 INFO measured{ESCAPE}"}))
    assert stream.getvalue() == "INFO a\\n12:00 INFO measured\\x1b[2J\n"
