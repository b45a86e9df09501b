"""Error sentences of the command line and the layers under it, each without a daemon: what, where, found, allowed."""

import errno
import os
import socket
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest
import zmq
from typer.testing import CliRunner

from pzctl.daemon.cli import commands, main
from pzctl.daemon.cli.commands import app
from pzctl.daemon.cli.records import export
from pzctl.daemon.cli.records import report_command as report
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, BuildError, parse_build, read_build
from pzctl.daemon.files.paths import home, keys_folder
from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.journal_writer import JournalWriter
from pzctl.daemon.journal.opening import open_store
from pzctl.daemon.journal.retention import copy_journal
from pzctl.daemon.page.page_process import listen, serve, served_beside
from pzctl.daemon.report.fit_widget import sliders
from pzctl.daemon.report.pictures.picture_file import save_picture
from pzctl.daemon.samples.sample_selection import journal_samples
from pzctl.daemon.server.access.access_control import AccessControl
from pzctl.daemon.server.analyzers.simulated_analyzer import simulated_instrument
from pzctl.daemon.server.publishing.spool import Spool
from pzctl.daemon.server.sockets import _bind, access_control_for
from pzctl.daemon.wire.curve_keys import read_client_key, write_secret
from pzctl.daemon.wire.events import BeatEvent, ReceivedEvent, decode
from pzctl.daemon.wire.result_messages import curves_of
from pzctl.fitters.plugins import load_configured
from pzctl.models.base.errors import PzctlError

BUILD = THESIS_BUILD
no_record: Any = None
ROWS = "".join(f"{1e6 + 1e4 * k},1,{-100 + k}\n" for k in range(30))


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A working folder with a recording, and a data folder without measurements."""
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path / "home"))
    monkeypatch.chdir(tmp_path)
    (tmp_path / "disk.csv").write_text(f"frequency_Hz,R_ohm,X_ohm\n{ROWS}")
    (tmp_path / "samples").mkdir()
    return tmp_path


@pytest.mark.parametrize(
    ("words", "says"),
    [
        (
            ["journal", "prune", "--before", "new year", "--backup", "old"],
            "--before new year: a day is needed, such as 2026-01-01",
        ),
        (["keys", "client", "ana", "--out", "disk.csv"], "--out disk.csv: this file exists already"),
        (["measure", "--step", "ml9"], "--step ml9: build 'thesis' has the steps disk, ml1, ml2"),
        (
            ["fit", "--fitter", "bvd", "--hold", "disk.c33D", "d=disk.csv"],
            "--hold, --tie, --prior and --bound name constants of a build; give --build as well",
        ),
        (["fit", "--fitter", "bvd", "d=disk.csv@memory"], "disk.csv carries no memory trace"),
        (
            ["fit", "--fitter", "bvd", "d=disk.csv", "d=disk.csv"],
            "d=disk.csv is given twice; a repeat is another sweep of the same step, in a file of its own",
        ),
        (
            ["fit", "--fitter", "bvd", "d=disk.csv", "--picture", "x.bmp"],
            "x.bmp: the name ends with '.bmp'; allowed are .png, .svg, .pdf",
        ),
        (
            ["fit", "--fitter", "bvd", "d=disk.csv", "--picture", "proof"],
            "proof: this is a folder; a file name is needed, such as proof/fit.png",
        ),
        (
            ["diagnose", "--build", "no.toml", "disk=disk.csv", "--effects", "cable,"],
            "--effects is 'cable,'; give names with commas between them, for example cable,bond-layer",
        ),
        (
            ["diagnose", "--build", str(BUILD), "disk=disk.csv", "--other-sample", "proof"],
            "proof/build.toml: cannot be read: No such file or directory",
        ),
        (
            ["fit", "--all", "samples"],
            "samples: no subfolder holds a build.toml; each sample needs build.toml and STEP.csv files",
        ),
        (
            ["screenshot", "s.tif", "--resource", "recording:disk.csv"],
            "recording:disk.csv: a recording has no fixture and no screen; name an instrument",
        ),
        (["new", "disk.csv"], "disk.csv: this file exists already; name another one"),
        (["new", "x.toml"], "x.toml: not written: the answers ended before the questions did"),
        (
            ["measure", "--fitter", "masson"],
            "no fitter 'masson' is installed; there are bvd, disk, disk2d, mason, mason-nelder-mead, nlopt-global, "
            "radial, sherrit-radial, sherrit-thickness, stack2d; did you mean 'mason'?",
        ),
        (["prove", "--out", "proof"], "proof: this folder holds a proof already; give --out another folder"),
        (["page", "--build", "no.toml"], "no.toml: cannot be read: No such file or directory"),
    ],
    ids=lambda value: " ".join(value[:2]) if isinstance(value, list) else None,
)
def test_a_command_that_cannot_be_done(here: Path, words: list[str], says: str) -> None:
    (here / "proof").mkdir()
    (here / "proof" / "truth.json").write_text("{}")
    done = CliRunner().invoke(app, words)
    assert isinstance(done.exception, PzctlError)
    assert str(done.exception) == says


def test_a_misspelt_name_is_wrong_usage_not_an_answer(here: Path) -> None:
    done = CliRunner().invoke(app, ["fit", "disc=disk.csv", "--build", str(BUILD)])
    assert isinstance(done.exception, PzctlError)
    assert str(done.exception) == "step 'disc' is not in build 'thesis', which has disk, ml1, ml2"
    assert done.exception.exit_status == 2


@pytest.mark.parametrize("words", ["measure", "measure --adaptive", "page", "daemon --page"])
def test_a_build_without_a_plan_is_refused_before_anything_starts(here: Path, words: str) -> None:
    (here / "x.toml").write_text(BUILD.read_text(encoding="utf-8").split("[sweep]", maxsplit=1)[0], encoding="utf-8")
    done = CliRunner().invoke(app, [*words.split(), "--build", "x.toml"])
    assert isinstance(done.exception, BuildError)
    assert str(done.exception).startswith("x.toml: the file has no [sweep], which says how to measure; write segments")


@pytest.mark.parametrize("words", [["page", "--port"], ["daemon", "--page-port"], ["sim", "--port"]], ids=" ".join)
def test_an_impossible_port_is_refused_before_anything_starts(here: Path, words: list[str]) -> None:
    done = CliRunner().invoke(app, [*words, "80000"])
    assert done.exit_code == 2
    assert "65535" in done.output
    assert not (here / "home").exists()


def long_name() -> object:
    return parse_build(BUILD.read_text(encoding="utf-8").replace('"thesis"', f'"{65 * "x"}"'))


def huge_file() -> object:
    with Path("huge.toml").open("wb") as file:
        file.truncate(1_000_001)
    return read_build(Path("huge.toml"))


def picture_below_a_file() -> object:
    from matplotlib.figure import Figure

    return save_picture(Figure(), Path("disk.csv/fit.png"), dpi=50)


def bad_key() -> object:
    Path("ana.key").write_text("{}")
    Path("ana.key").chmod(0o600)
    return read_client_key(Path("ana.key"))


def curves_of_two_lengths() -> object:
    z = np.zeros(3, complex)
    return curves_of(("disk",), {f"0.{part}": z[: 3 - k] for k, part in enumerate(PARTS)})


PARTS = ("frequency", "measured", "start", "fitted")


def no_steps() -> object:
    text = BUILD.read_text(encoding="utf-8")
    head, _, rest = text.partition("[[steps]]")
    return parse_build("steps = []\n" + head + rest[rest.index("[sweep]") :])


def journal_without_measurements() -> JournalReader:
    JournalWriter(Path("journal")).close()
    return JournalReader(Path("journal"))


def damaged_in_waiting() -> object:
    Path("unsaved").mkdir()
    (Path("unsaved") / "000000000.event").write_bytes(b"half a")
    kept = Spool(Path("unsaved"))
    assert len(kept) == 1
    return kept.first()


def nowhere_to_wait() -> None:
    Spool(Path("disk.csv")).put(BeatEvent(), ())


def beat_as_sweep() -> object:
    return ReceivedEvent(BeatEvent(), {}).sweep()


def bound(endpoint: str) -> object:
    context: zmq.Context[zmq.Socket[bytes]] = zmq.Context()
    try:
        return _bind(context.socket(zmq.ROUTER), endpoint, AccessControl(keys_folder(home()), outside=False))
    finally:
        context.term()


def simulator_that_does_not_start() -> object:
    with simulated_instrument(Path("sim.log"), {"jig": "spoon"}) as instrument:
        return instrument


@pytest.mark.parametrize(
    ("work", "says"),
    [
        (long_name, "build.toml: name has 65 characters; at most 64 are allowed"),
        (huge_file, "huge.toml: 1000001 bytes is too large for a build.toml"),
        (picture_below_a_file, "disk.csv/fit.png: the picture cannot be written: "),
        (
            lambda: copy_journal(no_record, Path("disk.csv")),
            "disk.csv: this is a file; a journal needs a new folder",
        ),
        (lambda: write_secret(Path("disk.csv/ana.key"), b""), "disk.csv: this folder cannot be made: "),
        (bad_key, "ana.key is not a key: message: "),
        (curves_of_two_lengths, "message: the columns of curve 0 (disk) differ in length"),
        (no_steps, "build.toml: steps is empty; at least one [[steps]] is needed"),
        (
            lambda: journal_samples(journal_without_measurements()),
            "the journal in journal holds no complete measurement",
        ),
        (lambda: journal_without_measurements().build("m-17"), "journal: no measurement 'm-17'"),
        (damaged_in_waiting, "unsaved/000000000.event: an event that waits for the journal cannot be read: "),
        (nowhere_to_wait, "disk.csv/000000000.event: an event that waits for the journal cannot be kept: "),
        (
            lambda: curves_of(("disk",), {"0.frequency": np.ones(3)}),
            "message: curve 0 (disk) has no column 'measured'",
        ),
        (
            lambda: decode([b"state.", b'{"v":1,"kind":"state","state":"started","run":"r","time":"t","seq":-1}']),
            "message: the header lacks run or time, or its seq is negative",
        ),
        (beat_as_sweep, "message: BeatEvent holds no sweep"),
        (lambda: read_client_key(Path("samples")), "samples cannot be read: Is a directory"),
        (lambda: write_secret(Path(300 * "k"), b""), f"{300 * 'k'} cannot be written: File name too long"),
        (
            lambda: report._write(Path("samples"), "<p>"),
            "samples: the report cannot be written: Is a directory",
        ),
        (
            lambda: export._write(no_record, None, "csv", Path("disk.csv/data")),
            "disk.csv/data: this folder cannot be made: Not a directory",
        ),
        (
            lambda: load_configured("no_such_module:Fitter"),
            "fitter 'no_such_module:Fitter' does not load: ModuleNotFoundError: No module named 'no_such_module'",
        ),
        (
            lambda: access_control_for(["foo"], Path()),
            "endpoint 'foo': tcp://HOST:PORT is needed, with * for any free port",
        ),
        (
            lambda: access_control_for(["tcp://0.0.0.0:*"], keys_folder(home())),
            "endpoint 'tcp://0.0.0.0:*' can be reached from other machines; that needs keys",
        ),
        (simulator_that_does_not_start, "simulated 4294A: it did not start: "),
    ],
    ids=lambda value: getattr(value, "__name__", None),
)
def test_what_lies_under_the_commands(here: Path, work: Callable[[], object], says: str) -> None:
    with pytest.raises(PzctlError) as caught:
        work()
    assert str(caught.value).startswith(says)


def test_a_port_that_is_taken(here: Path) -> None:
    with socket.create_server(("127.0.0.1", 0)) as taken:
        port = taken.getsockname()[1]
        with pytest.raises(PzctlError, match=rf"endpoint 'tcp://127.0.0.1:{port}' cannot be bound: Address already"):
            bound(f"tcp://127.0.0.1:{port}")
        with pytest.raises(PzctlError, match=rf"127.0.0.1:{port}: cannot listen there: Address already .*; another"):
            listen("127.0.0.1", port, "another")
        with (
            pytest.raises(PzctlError, match="cannot listen there: Address already in use; --page-port takes another"),
            served_beside(BUILD, port),
        ):
            pass


@pytest.mark.parametrize(
    ("module", "work", "says"),
    [
        (
            "starlette",
            lambda: serve(read_build(BUILD), None, None),
            r"starlette is not installed; the page needs it: pip install starlette uvicorn",
        ),
        (
            "ipywidgets",
            lambda: sliders(None),  # type: ignore[arg-type]
            r"ipywidgets is not installed; sliders need it: pip install ipywidgets",
        ),
        (
            "psycopg",
            lambda: open_store("postgresql://lab/record", write=False),
            r"a journal on PostgreSQL needs psycopg, which is not installed: pip install 'psycopg\[binary\]'",
        ),
    ],
)
def test_what_is_not_installed(
    monkeypatch: pytest.MonkeyPatch, module: str, work: Callable[[], object], says: str
) -> None:
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.delitem(sys.modules, "pzctl.daemon.journal.stores.postgres_store", raising=False)
    with pytest.raises(PzctlError, match=says):
        work()


@pytest.mark.skipif(os.name != "posix", reason="/dev/full is of Linux")
def test_a_file_that_cannot_be_written(here: Path) -> None:
    (here / "file").write_text("")
    answers = "\n".join(("S1", "16", "Pz27", "0.5", "0.001", "n", "air", "air"))
    done = CliRunner().invoke(app, ["new", "file/build.toml"], input=answers)
    assert str(done.exception) == "file/build.toml: cannot be written: Not a directory"


@pytest.mark.parametrize(
    ("error", "says"),
    [
        (OSError(errno.ENOSPC, "No space left on device"), "the output: cannot be written: No space left on device"),
        (OSError(errno.EFBIG, "File too large", "x.csv"), "x.csv: cannot be written: File too large"),
    ],
)
def test_a_full_disk_is_no_mistake_in_pzctl(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], error: OSError, says: str
) -> None:
    monkeypatch.setattr(commands, "app", mock.Mock(side_effect=error))
    with pytest.raises(SystemExit) as ended:
        main()
    assert (ended.value.code, capsys.readouterr().err) == (1, f"pzctl: {says}\n")


def test_an_internal_error_is_one_sentence_and_its_traceback_is_in_a_file(
    here: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    def broken() -> None:
        np.linalg.cholesky(np.array([[1.0, 2.0], [2.0, 1.0]]))

    monkeypatch.setattr(commands, "app", broken)
    with pytest.raises(SystemExit) as ended:
        main()
    said = capsys.readouterr().err
    assert ended.value.code == 1
    assert said.startswith("pzctl: a mistake in pzctl: LinAlgError: Matrix is not positive definite; where it happened")
    assert said.count("\n") == 1
    assert "cholesky(np.array" in (home() / "log" / "unexpected.log").read_text()
