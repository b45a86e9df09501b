"""The asyncio client: many questions at a time, listeners that lose nothing, cancelling that counts."""

import asyncio
from contextlib import aclosing

import pytest

from pzctl import connect_async
from pzctl.daemon.client.connection import DaemonError
from pzctl.daemon.wire.events import StateEvent, SweepEvent
from pzctl.fitters.interface import FitError
from pzctl.models.build import Build

ECHO = "guest_examples:Echo"


def test_measured_fitted_and_listened_to_side_by_side(start_daemon, build: Build) -> None:
    start_daemon("Echo", "Refuses")

    async def listen(lab, ready: asyncio.Event) -> list[int]:
        seqs: list[int] = []
        async with aclosing(lab.listen()) as events:
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
            with pytest.raises(FitError, match="sweep wider"):
                await lab.wait_fit("guest_examples:Refuses", measured[0].id)
            with pytest.raises(DaemonError, match="does not run it"):
                await lab.wait_fit("mason", measured[0].id)
            while not listener.done():
                await lab.measure(build, "ml1")
            seqs = await listener
            assert seqs == list(range(seqs[0], seqs[0] + len(seqs)))
            assert [h.event.seq async for h in lab.replay(2, 4)] == [2, 3, 4]

    asyncio.run(story())


def test_one_has_the_instrument_to_itself(start_daemon, build: Build) -> None:
    start_daemon()

    async def story() -> None:
        async with connect_async() as lab:
            async with lab.lease("ana", 60.0) as held:
                with pytest.raises(DaemonError, match="'ana' has the instrument to itself") as refused:
                    await lab.measure(build, "disk")
                assert refused.value.code == "leased"
                assert (await lab.measure(build, "disk", lease=held)).sweeps
            assert (await lab.measure(build, "disk")).sweeps
            assert (await lab.metrics()).counts["refused"] == 1

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
