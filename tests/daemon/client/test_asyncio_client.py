"""Features of the asyncio client only: concurrent conversations, and a cancelled task cancels its measurement."""

import asyncio
from contextlib import aclosing
from pathlib import Path

import pytest
from pruned_hole import endpoints, prune_unheard

from pzctl import connect_async
from pzctl.daemon.client import event_follower
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.wire.events import StateEvent, SweepEvent
from pzctl.models.build import Build

ECHO = "guest_examples:Echo"


def test_measuring_fitting_and_listening_run_concurrently(start_daemon, build: Build) -> None:
    start_daemon("Echo")

    async def listen(lab, ready: asyncio.Event) -> list[int]:
        seqs: list[int] = []
        async with aclosing(await lab.listen()) as events:
            ready.set()
            async for heard in events:
                seqs.append(heard.event.seq)
                if isinstance(heard.event, SweepEvent) and len(seqs) > 25:
                    return seqs
        return seqs

    async def story() -> None:
        async with connect_async() as lab:
            ready = asyncio.Event()
            listener = asyncio.create_task(listen(lab, ready))
            await ready.wait()
            measured = await asyncio.gather(*(lab.measure(build, "disk") for _ in range(5)))
            assert all([sweep.frequency.size for sweep in one.sweeps] == [51, 41] for one in measured)
            results = await asyncio.gather(*(lab.wait_fit(ECHO, one.id) for one in measured))
            assert {result.constants["disk.Z"].re for result in results} == {
                abs(one.sweeps[-1].impedance[0]) for one in measured
            }
            while not listener.done():
                await lab.measure(build, "ml1")
            seqs = await listener
            assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))

    asyncio.run(story())


def test_who_stops_waiting_cancels_the_measurement(start_daemon, build: Build) -> None:
    start_daemon(time_scale=1.0)

    async def story() -> list[str]:
        async with connect_async() as lab:
            under_way = asyncio.Event()
            waiting = asyncio.create_task(lab.measure(build, "disk", progress=lambda _: under_way.set()))
            await under_way.wait()
            waiting.cancel()
            with pytest.raises(asyncio.CancelledError):
                await waiting
            while True:
                events = [heard.event async for heard in lab.replay(1)]
                states = [event.state for event in events if isinstance(event, StateEvent) and event.measurement]
                if "cancelled" in states:
                    assert not any(isinstance(event, SweepEvent) for event in events)
                    return states
                await asyncio.sleep(0.05)

    assert asyncio.run(asyncio.wait_for(story(), 30)) == ["queued", "measuring", "cancelling", "cancelled"]


def test_a_measurement_whose_events_are_gone_is_not_waited_for(
    start_daemon, build: Build, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(event_follower, "SILENCE", 90.0)
    where = start_daemon(time_scale=1.0, **endpoints())

    async def story() -> None:
        async with connect_async() as lab:
            under_way = asyncio.Event()
            waiting = asyncio.create_task(lab.measure(build, "disk", progress=lambda _: under_way.set()))
            await under_way.wait()
            await asyncio.to_thread(prune_unheard, start_daemon, where, tmp_path, build)
            with pytest.raises(DaemonError, match=r"its outcome is unknown; events .* pruned on") as refused:
                await waiting
            assert refused.value.code == "missing"

    asyncio.run(asyncio.wait_for(story(), 90))
