"""Batches: the same answers on all cores, on a Dask cluster and one by one; a failing sample stops no other."""

import os
import sys
from collections.abc import Iterator
from dataclasses import fields
from pathlib import Path
from typing import Any
from unittest import mock

import numpy as np
import pytest

from pzctl.fitters.interface import FitTask
from pzctl.fitters.plugins import PluginError
from pzctl.fitters.population.batch import BatchError, BatchJob, BatchOutcome, fit_job, fit_on_cores, fit_on_dask
from pzctl.models.build import Build, LayerSpec, LoadSpec, Quantity, Step
from pzctl.models.materials import find
from pzctl.models.stack import HalfSpace, Piezo, Stack
from pzctl.models.sweep import Sweep

AREA = Quantity(2.0106e-4)


def disk(name: str, c33D: complex, seed: int) -> BatchJob:
    """A bare Pz27 disk with its own stiffness and relative noise of 1e-3."""
    pz27 = {key: find("Pz27").values[key] for key in ("density", "c33D", "h33", "eps33S")}
    values = {"thickness": Quantity(5.12e-4, u=1e-6), **pz27}
    layer = Piezo("disk", 5.12e-4, 7700.0, c33D, pz27["h33"].value, pz27["eps33S"].value)
    f = np.linspace(2e6, 6e6, 201)
    z = Stack((layer,), HalfSpace("air", 413.0), HalfSpace("air", 413.0), AREA.re).impedance(f)
    rng = np.random.default_rng(seed)
    noise = 1e-3 * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
    air = LoadSpec("air", Quantity(413.0))
    build = Build(name, AREA, (LayerSpec("disk", "piezo", values),), air, air, (Step("disk", ("disk",)),))
    return BatchJob(name, FitTask(build, {"disk": (Sweep(f, z * (1 + noise), id=f"{name}.csv"),)}))


def flat(name: str) -> BatchJob:
    """A resistor in place of a disk."""
    job = disk(name, 1.5e11 * (1 + 0.01j), 0)
    f = job.task.sweeps["disk"][0].frequency
    return BatchJob(name, FitTask(job.task.build, {"disk": (Sweep(f, np.full(f.size, 50.0 + 0j)),)}))


JOBS = [disk("S1", 1.50e11 * (1 + 0.010j), 1), flat("broken"), disk("S3", 1.55e11 * (1 + 0.012j), 3)]


def content(part: Any) -> Any:
    """A result as nested plain values, without `seconds`, to be compared to the last bit."""
    if isinstance(part, np.ndarray):
        return part.tobytes()
    if hasattr(part, "__dataclass_fields__"):
        return {f.name: content(getattr(part, f.name)) for f in fields(part) if f.name != "seconds"}
    if isinstance(part, dict):
        return {key: content(value) for key, value in part.items()}
    if isinstance(part, tuple):
        return tuple(map(content, part))
    return part


@pytest.fixture(scope="module")
def on_cores() -> tuple[BatchOutcome, ...]:
    return fit_on_cores(JOBS, "mason")


def test_outcomes_come_in_order_and_a_failure_stops_nobody(on_cores: tuple[BatchOutcome, ...]) -> None:
    assert [outcome.sample for outcome in on_cores] == ["S1", "broken", "S3"]
    for outcome, true in ((on_cores[0], 1.50e11), (on_cores[2], 1.55e11)):
        assert outcome.result is not None
        constant = outcome.result.constants["disk.c33D"]
        assert constant.u_re is not None
        assert abs(constant.re - true) < 4 * constant.u_re
    assert on_cores[1].result is None
    assert "resonance" in (on_cores[1].error or "")


def test_processes_answer_as_one_by_one(on_cores: tuple[BatchOutcome, ...]) -> None:
    assert content(on_cores) == content(tuple(fit_job(job, "mason") for job in JOBS))


@pytest.fixture(scope="module")
def cluster() -> Iterator[str]:
    distributed = pytest.importorskip("distributed")
    local = {"dashboard_address": "127.0.0.1:0", "host": "127.0.0.1"}
    with (
        mock.patch.dict(os.environ),  # Dask sets PYTHONHASHSEED and leaves it: nothing would be forked after it
        distributed.LocalCluster(n_workers=2, threads_per_worker=1, processes=True, **local) as running,
    ):
        yield running.scheduler_address


def test_a_dask_cluster_answers_the_same_to_the_last_bit(cluster: str, on_cores: tuple[BatchOutcome, ...]) -> None:
    heard: list[str] = []
    bare = cluster.removeprefix("tcp://")
    on_dask = fit_on_dask(JOBS, "mason", bare, lambda outcome: heard.append(outcome.sample))
    assert content(on_dask) == content(on_cores)
    assert sorted(heard) == ["S1", "S3", "broken"]


def test_without_dask_it_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(BatchError, match=r"not installed: pip install 'dask\[distributed\]'"):
        fit_on_dask(JOBS, "mason", "tcp://127.0.0.1:8786")


@pytest.mark.parametrize("address", ["nonsense", "udp://127.0.0.1:8786", "tcp://127.0.0.1", "tcp://:8786", "127.0.0.1"])
def test_what_is_no_address_is_said(address: str) -> None:
    with pytest.raises(BatchError, match=r"scheduler .*: HOST:PORT is needed"):
        fit_on_dask(JOBS, "mason", address)


@pytest.mark.parametrize("address", ["tcp://127.0.0.1:1", "127.0.0.1:1", "tcp://127.0.0.1:99999"])
def test_where_no_scheduler_answers_it_says_so(address: str, monkeypatch: pytest.MonkeyPatch) -> None:
    pytest.importorskip("distributed")
    monkeypatch.setattr("pzctl.fitters.population.batch._PATIENCE", 1.0)
    with pytest.raises(BatchError, match="no Dask scheduler answers at"):
        fit_on_dask(JOBS, "mason", address)


def test_an_unknown_fitter_is_said_before_anything_starts() -> None:
    with pytest.raises(PluginError, match="no fitter 'masn' is installed"):
        fit_on_cores(JOBS, "masn")


FITTER = """
import os
class Odd:
    name, version, summary = "odd", "1", "dies of one sample, fails of the rest"
    def fit(self, task, progress=None):
        if task.build.name == "broken":
            os._exit(9)
        raise ZeroDivisionError(os.environ["OPENBLAS_NUM_THREADS"])
"""


@pytest.fixture
def odd_fitter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    """A third party's fitter, installed for the processes of this test."""
    (tmp_path / "odd_fitter.py").write_text(FITTER)
    info = tmp_path / "odd_fitter-1.dist-info"
    info.mkdir()
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: odd-fitter\nVersion: 1\n")
    (info / "entry_points.txt").write_text("[pzctl.fitters]\nodd = odd_fitter:Odd\n")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    return "odd"


def test_a_fitter_that_fails_or_dies_is_an_outcome(odd_fitter: str) -> None:
    before = os.environ.get("OPENBLAS_NUM_THREADS")
    fails, dies = fit_on_cores(JOBS[:1], odd_fitter), fit_on_cores(JOBS[1:2], odd_fitter)
    assert fails[0].error == "fitter 'odd' failed: ZeroDivisionError: 1"
    assert dies[0].error == "a process of the batch died (killed, or out of memory)"
    assert os.environ.get("OPENBLAS_NUM_THREADS") == before
