"""`pzctl doctor`, `show` and `export` as a person calls them, on a journal that a real daemon wrote."""

import json
import re
import shutil
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.io import netcdf_file
from typer.testing import CliRunner, Result

from pzctl.daemon.cli.commands import app
from pzctl.daemon.cli.lab.doctor import Unwell
from pzctl.daemon.files.paths import home
from pzctl.daemon.server.checkup import _devices, _folder, _instrument, _own_folder
from pzctl.drivers.recordings import read_recording
from pzctl.models.base.errors import PzctlError
from pzctl.sim.server import SimOptions, running


def run(*words: str | Path) -> Result:
    return CliRunner().invoke(app, [*map(str, words)])


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    """A data folder with the simulated transducer's first step, measured and fitted."""
    folder = tmp_path_factory.mktemp("measured")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PZCTL_HOME", str(folder))
        done = run("measure", "--step", "disk", "--fit", "--time-scale", "0", "--json")
        assert done.exit_code == 0, done.stderr
        yield folder


def test_show_gives_the_constants_and_the_picture(measured: Path, tmp_path: Path) -> None:
    done = run("show", "thesis", "--pictures", tmp_path)
    assert done.exit_code == 0
    assert "thesis, step disk: 1602 points in 2 sweep(s)" in done.stdout
    assert "disk.c33D" in done.stdout
    assert (tmp_path / "thesis-disk-mason.png").read_bytes().startswith(b"\x89PNG")
    answer = json.loads(run("show", "thesis", "--json").stdout)
    (step,) = answer["steps"]
    assert step["step"] == "disk"
    assert {fit["fitter"] for fit in step["fits"]} == {"mason"}
    again = json.loads(run("show", step["measurement"], "--json").stdout)
    assert again["steps"] == answer["steps"], "a measurement's id shows the same"


@pytest.mark.parametrize(
    ("words", "sentence"),
    [
        (["show", "tesis"], "did you mean 'thesis'"),
        (["show", "thesis", "--step", "ml9"], "step 'ml9' was not measured; measured: disk"),
        (["show", "thesis", "--fitter", "masson"], "there is no fit by 'masson'; fitted by "),
        (["export", "thesis", "--step", "ml9"], "step 'ml9' was not measured; measured: disk"),
        (["export", "thesis", "--format", "xls"], "allowed are csv, touchstone, netcdf, hdf5"),
    ],
)
def test_what_is_not_there_is_one_sentence(measured: Path, words: list[str], sentence: str) -> None:
    done = run(*words)
    assert isinstance(done.exception, PzctlError)
    assert sentence in str(done.exception)


@pytest.mark.parametrize("form", ["csv", "touchstone", "netcdf", "hdf5"])
def test_exports_hold_what_was_measured(measured: Path, tmp_path: Path, form: str) -> None:
    done = run("export", "thesis", "--to", tmp_path / form, "--format", form, "--json")
    files = [Path(name) for name in json.loads(done.stdout)["files"]]
    assert [path.stem for path in files] == ["thesis-disk-1", "thesis-disk-2"]
    run("export", "thesis", "--to", tmp_path)
    exact = read_recording(tmp_path / "thesis-disk-1.csv")
    if form == "netcdf":
        with netcdf_file(files[0], mmap=False) as file:
            z = file.variables["resistance"][:] + 1j * file.variables["reactance"][:]
    else:
        z = read_recording(files[0]).impedance
    assert np.allclose(z, exact.impedance, rtol=1e-9)
    assert exact.settings["bandwidth"] == 5


def test_the_fitted_stack_is_exported_as_a_netlist(measured: Path, tmp_path: Path) -> None:
    done = run("export", "thesis", "--to", tmp_path, "--format", "mason", "--json")
    (file,) = map(Path, json.loads(done.stdout)["files"])
    netlist = file.read_text(encoding="utf-8")
    assert file.name == "thesis-disk.cir"
    assert "constants of the fit by mason" in netlist
    c33D = json.loads(run("show", "thesis", "--json").stdout)["steps"][0]["fits"][0]["constants"]["disk.c33D"]
    compliance = re.search(r"LTRA\(L=(\S+) ", netlist)
    assert compliance
    assert float(compliance[1]) == pytest.approx((1 / complex(c33D["re"], c33D["im"])).real / 2.01062e-4, rel=1e-3)


def test_the_doctor_of_a_machine_that_is_well() -> None:
    """In a process of its own: the search for instruments has child processes too."""
    with _own_folder():
        pzctl = Path(sys.executable).with_name("pzctl")
        done = subprocess.run([pzctl, "doctor", "--json"], capture_output=True, text=True, check=False, timeout=110)
    checks = {check["name"]: check for check in json.loads(done.stdout)["checks"]}
    assert done.returncode == 0, done.stderr
    assert "was measured, recorded, published and fitted" in checks["rehearsal"]["says"]
    assert checks["journal"]["says"].startswith("empty")


@pytest.mark.parametrize(
    ("free", "status", "says"),
    [
        (3, "fault", "3 MB are free; 64 MB are needed to measure"),
        (100, "note", "only 105 MB are free"),
        (999, "ok", ""),
    ],
)
def test_the_doctor_reports_a_disk_that_is_too_full_to_measure(
    free: int, status: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    usage = SimpleNamespace(total=1 << 30, used=0, free=free << 20)
    monkeypatch.setattr("pzctl.daemon.server.checkup.shutil.disk_usage", lambda _: usage)
    found = _folder()
    assert found.status == status
    assert says in found.says


def test_the_doctor_finds_a_damaged_journal_and_a_silent_instrument(
    measured: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copytree(measured, tmp_path / "home")
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path / "home"))
    array = sorted((home() / "journal" / "arrays").glob("*.bin"))[0]
    array.write_bytes(array.read_bytes()[:-1] + b"?")
    done = run("doctor", "--resource", "127.0.0.1:9", "--json")
    faults = {check["name"]: check["says"] for check in json.loads(done.stdout)["checks"] if check["status"] == "fault"}
    assert isinstance(done.exception, Unwell)
    assert "damaged" in faults["journal"]
    assert "nothing listens there" in faults["instrument"]
    assert "rehearsal" not in faults


def test_a_device_without_access_permission_is_named(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "ttyUSB0").touch()
    monkeypatch.setattr("os.access", lambda path, mode: False)
    (check,) = _devices(tmp_path)
    assert "ttyUSB0" in check.says
    assert "usermod" in check.remedy


def test_the_doctor_sweeps_with_the_named_instrument(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, prologix_port=0)) as sim:
        for resource, told in (
            (sim.resource, "by polling the status byte"),
            (f"PROLOGIX::127.0.0.1:{sim.prologix_port}::17", "by its service request"),
        ):
            who, path = _instrument(resource)
            assert (who.status, path.status) == ("ok", "ok")
            assert "HEWLETT-PACKARD,4294A" in who.says
            assert path.says.startswith("11 points swept and read in ")
            assert told in path.says
