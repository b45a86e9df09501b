"""The event loop of the daemon: it has a turn for others, ends with the daemon, and gets over errors."""

import asyncio
from collections.abc import Awaitable
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from pzctl.daemon.client.async_client import AsyncClient
from pzctl.daemon.files.worker_limits import Limits
from pzctl.daemon.server.analyzers.acquisition import BEFORE_IT_BEGAN, Acquisition, MeasurementJob
from pzctl.daemon.server.workers import job_runner
from pzctl.daemon.server.workers.job_runner import JobRunner
from pzctl.daemon.wire.events import Event, InstrumentInfo, StateEvent, SweepEvent
from pzctl.models.build import Build
from pzctl.models.sweep import Sweep

INSTRUMENT = InstrumentInfo("R", "I", "4294A", "1", "1", simulated=True)


def _acquisition(order: list[str]) -> Acquisition:
    """Return the queue of an analyzer that measures three sweeps; the published events are put into `order`."""

    async def measure(*_: object) -> tuple[Sweep, ...]:
        return (Sweep(np.linspace(1e6, 2e6, 11), np.ones(11, complex)),) * 3

    async def ready() -> None:
        return

    def publish(event: Event, _: object) -> None:
        order.append("sweep" if isinstance(event, SweepEvent) else getattr(event, "state", "") + _says(event))

    return Acquisition("a", SimpleNamespace(measure=measure), INSTRUMENT, publish, ready, lambda sweep: sweep)  # type: ignore[arg-type]


def _says(event: Event) -> str:
    return f": {event.says}" if isinstance(event, StateEvent) and event.state == "cancelled" else ""


async def _until(order: list[str], last: str, *others: Awaitable[None]) -> None:
    tasks = [asyncio.ensure_future(other) for other in others]
    async with asyncio.timeout(60):
        while not any(one.startswith(last) for one in order):
            await asyncio.sleep(0)
    for task in tasks:
        task.cancel()


def test_others_have_a_turn_between_two_sweeps_but_not_before_the_end(build: Build) -> None:
    """Writing hundreds of sweeps takes the disk seconds; a fitter may answer once it has heard the last one."""
    order: list[str] = []

    async def others() -> None:
        while True:
            order.append("turn")
            await asyncio.sleep(0)

    async def measured() -> None:
        queue = _acquisition(order)
        assert build.plan is not None
        queue.add(MeasurementJob("m", build, "disk", build.plan))
        await _until(order, "measured", queue.work(), others())

    asyncio.run(measured())
    text = " ".join(order)
    assert "sweep sweep" not in text
    assert "sweep measured" in text


def test_what_is_asked_of_an_ending_daemon_is_not_measured(build: Build) -> None:
    order: list[str] = []

    async def ended() -> None:
        queue = _acquisition(order)
        queue.cancel_all()
        assert build.plan is not None
        queue.add(MeasurementJob("m", build, "disk", build.plan))
        await _until(order, "cancelled", queue.work())

    asyncio.run(ended())
    assert order == [f"cancelled: {BEFORE_IT_BEGAN}"]


def test_the_names_of_the_effects_are_looked_up_again_if_that_failed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fails() -> frozenset[str]:
        raise OSError("no memory")

    async def told() -> frozenset[str]:
        jobs = JobRunner(tmp_path, "", "", None, Limits(), lambda _: None)
        monkeypatch.setattr(job_runner, "_effects", fails)
        with pytest.raises(OSError, match="no memory"):
            await jobs.effects()
        monkeypatch.setattr(job_runner, "_effects", lambda: frozenset({"leakage"}))
        return await jobs.effects()

    assert "leakage" in asyncio.run(told())


def test_a_malformed_answer_leaves_the_client_reading() -> None:
    """It fails what waits, but not what has been answered a moment before."""

    async def told() -> list[bytes]:
        async with AsyncClient("inproc://events", "inproc://requests") as lab:
            first, second = (asyncio.get_running_loop().create_future() for _ in range(2))
            first.set_result([b"answered"])
            coming = [({"first": first}, [b"nonsense"]), ({"second": second}, [b'{"id": "second", "ok": true}'])]

            async def received() -> list[bytes]:
                if not coming:
                    return await asyncio.Future()
                lab._waiting, frames = coming.pop(0)
                return frames

            asker, lab._asker = lab._asker, SimpleNamespace(recv_multipart=received)  # type: ignore[assignment]
            done, _ = await asyncio.wait({lab._reader, second}, timeout=60, return_when=asyncio.FIRST_COMPLETED)
            lab._asker = asker
            return done.pop().result()

    assert asyncio.run(told()) == [b'{"id": "second", "ok": true}']
