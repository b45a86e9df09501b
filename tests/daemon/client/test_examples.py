"""The examples run as described, against a daemon with a simulated instrument."""

import csv
import importlib.util
import json
import sys
import threading
from pathlib import Path
from types import ModuleType

import pytest

import pzctl
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build

EXAMPLES = Path(__file__).parents[3] / "examples"
THESIS = THESIS_BUILD


def load(name: str) -> ModuleType:
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_a_scan_against_temperature(start_daemon, tmp_path: Path) -> None:
    start_daemon()
    reached: list[float] = []

    def reach(wanted: float) -> float:
        reached.append(wanted)
        with (
            pzctl.connect() as other,
            pytest.raises(DaemonError, match="the instrument is leased to 'temperature scan'"),
        ):
            other.measure(read_build(THESIS), "disk")
        return wanted + 0.1

    with (tmp_path / "scan.csv").open("w", newline="") as out:
        load("parameter_scan").scan(read_build(THESIS), [20.0, 30.0], out, reach)
    rows = list(csv.DictReader((tmp_path / "scan.csv").read_text(encoding="utf-8").splitlines()))
    assert [float(row["temperature_C"]) for row in rows] == [20.1, 30.1]
    assert reached == [20.0, 30.0]
    assert all(1e11 < float(row["disk.c33D.re"]) < 2e11 for row in rows)


def test_a_pymeasure_procedure(start_daemon, tmp_path: Path) -> None:
    start_daemon()
    pymeasure = load("pymeasure_procedure")
    sys.modules["pymeasure_procedure"] = pymeasure  # PyMeasure writes the procedure's module into its file
    pymeasure.main(str(THESIS), str(tmp_path / "results.csv"))
    lines = (tmp_path / "results.csv").read_text(encoding="utf-8").splitlines()
    rows = list(csv.DictReader(line for line in lines if not line.startswith("#")))
    with pzctl.connect() as lab:
        (history,) = lab.samples()
        heard = lab.sweeps(history.measurements[0].measurement)
    Z = [z for one in heard for z in one.sweep().impedance]
    assert [(float(row["R (ohm)"]), float(row["X (ohm)"])) for row in rows] == [(z.real, z.imag) for z in Z]


def test_a_bluesky_device(start_daemon) -> None:
    start_daemon()
    device = load("bluesky_device").Transducer("pz", read_build(THESIS), "disk")
    ended = threading.Event()
    status = device.trigger()
    status.add_callback(lambda _: ended.set())
    assert status.exception(60) is None
    assert ended.wait(5)
    assert status.success
    read, described = device.read(), device.describe()
    assert read.keys() == described.keys()
    assert 1e11 < read["pz-disk_c33D_re"]["value"] < 2e11
    assert described["pz-disk_c33D_re"]["units"] == "Pa"


def test_a_bluesky_device_whose_daemon_has_gone(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    status = load("bluesky_device").Transducer("pz", read_build(THESIS), "disk").trigger()
    assert "no daemon runs" in str(status.exception(20))
    assert not status.success


def test_the_notebook(start_daemon) -> None:
    start_daemon()
    notebook = json.loads((EXAMPLES / "notebook.ipynb").read_text(encoding="utf-8"))
    names: dict[str, object] = {}
    for cell in notebook["cells"]:
        if cell["cell_type"] == "code":
            assert cell["outputs"] == [], "kept without outputs"
            exec("".join(cell["source"]), names)  # noqa: S102
    assert names["result"].converged  # type: ignore[attr-defined]
    assert names["diagnosis"]["says"]  # type: ignore[index]
