"""A sweep states date and fixture of its compensation, and has a note where that is too old or not known."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from pzctl.daemon.client.client import connect
from pzctl.daemon.client.location import Location
from pzctl.daemon.files.compensation_record import CompensationRecord, keep_record
from pzctl.daemon.files.paths import compensation_file
from pzctl.daemon.server.analyzers.compensation_check import UNDATED, CompensationCheck
from pzctl.drivers import open_analyzer
from pzctl.drivers.agilent4294a.instrument import Agilent4294A
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.server import SimOptions, running

TAKEN = "2026-11-01T08:00:00.000Z"
CLIPS = CompensationRecord("none", ("open", "short"), TAKEN, "clips-2")


def sweep(begun: str, *standards: str, adapter: str = "none") -> Sweep:
    """A sweep as the 4294A's driver returns it."""
    settings = {"instrument": "4294A,1", "adapter": adapter, "compensation": list(standards)}
    return Sweep(np.array([1e6, 2e6]), np.array([50.0 + 0j, 60.0 + 0j]), settings, begun)


@pytest.fixture
def record(tmp_path: Path) -> Path:
    keep_record(tmp_path / "c.json", "another,2", CompensationRecord("4TP 1 m", ("open",), TAKEN))
    keep_record(tmp_path / "c.json", "4294A,1", CLIPS)
    return tmp_path / "c.json"


@pytest.mark.parametrize(
    ("begun", "days", "noted"),
    [
        ("2026-11-08T07:59:00.000Z", 7.0, False),
        ("2026-11-08T08:01:00.000Z", 7.0, True),
        ("2027-11-08T08:01:00.000Z", None, False),
    ],
)
def test_an_expired_compensation_is_noted_with_fixture_date_and_age(
    record: Path, begun: str, days: float | None, noted: bool
) -> None:
    found = CompensationCheck(record, days)(sweep(begun, "open", "short"))
    assert (found.settings["compensation_taken"], found.settings["compensation_fixture"]) == (TAKEN, "clips-2")
    told = "The compensation of fixture 'clips-2' was 7.0 days old, taken on 2026-11-01; this bench allows 7"
    assert [note.startswith(told) for note in found.notes] == ([True] if noted else [])


@pytest.mark.parametrize(
    "other", [("open",), ("open", "short", "load")], ids=["one is off", "one more than was written down"]
)
def test_a_compensation_that_nobody_dated_is_noted(record: Path, other: tuple[str, ...]) -> None:
    found = CompensationCheck(record, None)(sweep(TAKEN, *other))
    assert (found.notes, "compensation_taken" in found.settings) == ((UNDATED,), False)
    assert CompensationCheck(record.with_name("none.json"), None)(sweep(TAKEN, "open", "short")).notes == (UNDATED,)
    assert CompensationCheck(record, None)(sweep(TAKEN, "open", "short", adapter="7 mm")).notes == (UNDATED,)


def test_without_compensation_there_is_no_note(record: Path) -> None:
    assert CompensationCheck(record, 7.0)(sweep(TAKEN)).notes == ()


def test_the_daemon_continues_to_measure_and_adds_a_note(
    start_daemon: Callable[..., Location], build: Build, tmp_path: Path
) -> None:
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0)) as sim:
        analyzer = open_analyzer(sim.resource)
        assert isinstance(analyzer, Agilent4294A)
        taken = analyzer.compensate(
            ["open"], lambda _: bench_command("127.0.0.1", sim.bench_port, command="connect", what="open") and None
        )
        analyzer.close()
        bench_command("127.0.0.1", sim.bench_port, command="connect", what="device")
        old = CompensationRecord("none", ("open",), "2020-01-01T08:00:00.000Z", "jig")
        keep_record(compensation_file(tmp_path), taken.instrument, old)
        start_daemon(resource=sim.resource, compensation_days=7.0)
        with connect() as lab:
            measured = lab.measure(build, "disk")
    assert len(measured.sweeps) == 2
    for one in measured.sweeps:
        assert one.settings["compensation_fixture"] == "jig"
        assert any("compensation of fixture 'jig' was" in note for note in one.notes)
