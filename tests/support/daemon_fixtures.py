"""A daemon in its own process and on its own data folder, with a simulated 4294A that answers at once."""

import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import pytest

from pzctl.daemon.client.location import Location
from pzctl.daemon.files.daemon_options import DaemonOptions
from pzctl.daemon.server.launch import start
from pzctl.models.build import Build, LayerSpec, LoadSpec, Quantity, Step
from pzctl.models.sweep_plan import Segment, SweepPlan

DISK = {
    "thickness": Quantity(5.12e-4, u=1e-6),
    "density": Quantity(7700.0),
    "c33D": Quantity(1.5e11, 1.6e9),
    "h33": Quantity(1.97e9),
    "eps33S": Quantity(7.5e-9, -8e-11),
}
MATCHING_LAYER = {"thickness": Quantity(2e-4), "z": Quantity(6e6), "c": Quantity(2500.0), "q": Quantity(30.0)}


@pytest.fixture
def build() -> Build:
    air = LoadSpec("air", Quantity(413.0))
    return Build(
        name="S4.a",
        area=Quantity(2.01e-4),
        layers=(LayerSpec("disk", "piezo", DISK), LayerSpec("ml1", "elastic", MATCHING_LAYER)),
        back=air,
        front=air,
        steps=(Step("disk", ("disk",)), Step("ml1", ("disk", "ml1"))),
        plan=SweepPlan((Segment(1e6, 6e6, 51), Segment(5e5, 15.5e6, 41))),
    )


@pytest.fixture
def start_daemon(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Callable[..., Location]]:
    """Return a function that starts a daemon on this test's data folder; it is ended after the test."""
    monkeypatch.setenv("PZCTL_HOME", str(tmp_path))
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parent), prepend=os.pathsep)
    pids: list[int] = []

    def begin(
        *fitters: str,
        names: tuple[str, ...] = (),
        time_scale: float = 0.0,
        simulator: Mapping[str, object] | None = None,
        **options: object,
    ) -> Location:
        named = (*(f"guest_examples:{name}" for name in fitters), *names)
        simulated = {"time_scale": time_scale, **(simulator or {})}
        where = start(DaemonOptions(fitters=named, simulator=simulated, **options))  # type: ignore[arg-type]
        pids.append(where.pid)
        return where

    yield begin
    for pid in pids:
        _end(pid, signal.SIGKILL)


@pytest.fixture
def end() -> Callable[[int, signal.Signals], None]:
    """Return a function that sends a signal to a daemon this test started and waits until it has ended."""
    return _end


@pytest.fixture
def wait_until() -> Callable[[Callable[[], object]], None]:
    """Return a function that waits until something is true, and fails after a time long enough for any machine."""

    def wait(true: Callable[[], object]) -> None:
        deadline = time.monotonic() + 120
        while not true():
            assert time.monotonic() < deadline, "it did not become true"
            time.sleep(0.02)

    return wait


def _end(pid: int, how: signal.Signals) -> None:
    try:
        os.kill(pid, how)
        os.waitpid(pid, 0)
    except (ProcessLookupError, ChildProcessError):
        return
