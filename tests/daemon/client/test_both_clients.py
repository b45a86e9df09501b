"""The blocking and the asyncio client: the same methods, and the same events from a real daemon."""

import asyncio
import inspect
from collections.abc import AsyncGenerator, Callable
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from pathlib import Path
from typing import Any

import pytest
from pruned_hole import endpoints, prune_unheard

from pzctl import connect, connect_async
from pzctl.daemon.client import event_follower
from pzctl.daemon.client.async_client import AsyncClient
from pzctl.daemon.client.client import Client
from pzctl.daemon.client.conversations import MissingEventsWarning
from pzctl.daemon.client.protocol import DaemonError
from pzctl.daemon.wire.events import StateEvent, SweepEvent
from pzctl.daemon.wire.replies import MissingEvents
from pzctl.fitters.interface import FitError
from pzctl.models.build import Build

ECHO = "guest_examples:Echo"


class Awaited:
    """The blocking client with the interface of the asyncio client, so that one scenario tests both."""

    def __init__(self, lab: Client) -> None:
        self._lab = lab

    def __getattr__(self, name: str) -> Callable[..., Any]:
        method = getattr(self._lab, name)

        async def called(*args: Any, **kwargs: Any) -> Any:
            answer = method(*args, **kwargs)
            return each(answer) if name == "listen" else answer

        @asynccontextmanager
        async def entered(*args: Any, **kwargs: Any) -> AsyncGenerator[Any]:
            with method(*args, **kwargs) as given:
                yield given

        async def each(items: Any) -> AsyncGenerator[Any]:
            for item in items:
                yield item

        others = {"lease": entered, "replay": lambda *args, **kwargs: each(method(*args, **kwargs))}
        return others.get(name, called)


@asynccontextmanager
async def blocking() -> AsyncGenerator[Any]:
    with connect() as lab:
        yield Awaited(lab)


def parameters(method: Callable[..., Any]) -> list[inspect.Parameter]:
    return list(inspect.signature(method).parameters.values())


def test_both_clients_have_the_same_methods_arguments_and_docstrings() -> None:
    kinds: tuple[type, type] = (Client, AsyncClient)
    named = [{name: one for name, one in inspect.getmembers(kind) if not name.startswith("_")} for kind in kinds]
    assert named[0].keys() == named[1].keys()
    assert {"measure", "diagnose", "submit", "replay", "wait_diagnosis"} <= named[0].keys()
    for name, method in named[0].items():
        assert parameters(method) == parameters(named[1][name]), name
        if name != "close":
            assert method.__doc__ == named[1][name].__doc__, name


@pytest.mark.parametrize("client", [blocking, connect_async])
def test_both_are_told_the_same_story(
    start_daemon, build: Build, client: Callable[[], AbstractAsyncContextManager[Any]]
) -> None:
    start_daemon("Echo", "Refuses")

    async def story() -> None:
        async with client() as lab:
            events = await lab.listen(60)
            fractions: list[float] = []
            one = await lab.measure(build, "disk", None, lambda event: fractions.append(event.fraction), priority=1)
            assert [sweep.frequency.size for sweep in one.sweeps] == [51, 41]
            assert sorted(fractions) == fractions != []
            heard = [(await anext(events)).event]
            while not (isinstance(heard[-1], StateEvent) and heard[-1].state == "measured"):
                heard.append((await anext(events)).event)
            assert [event.seq for event in heard] == list(range(heard[0].seq, heard[-1].seq + 1))
            sweeps = [event.id for event in heard if isinstance(event, SweepEvent)]
            assert sweeps == [sweep.id for sweep in one.sweeps], "heard although they were waited for as well"
            await events.aclose()
            assert [again.event async for again in lab.replay(heard[0].seq, heard[-1].seq)] == heard
            assert [again.event.id for again in await lab.sweeps(one.id)] == sweeps

            result = await lab.wait_fit(ECHO, one.id)
            assert result.constants["disk.Z"].re == abs(one.sweeps[-1].impedance[0])
            assert (await lab.fit(one.id, ECHO)).constants == result.constants
            with pytest.raises(FitError, match="sweep wider"):
                await lab.wait_fit("guest_examples:Refuses", one.id)
            with pytest.raises(DaemonError, match="does not run it"):
                await lab.wait_fit("mason", one.id)

            aside = await lab.measure(build, "disk", decides=one.id)
            assert [step.measurement for step in (await lab.samples(build.name))[0].measurements] == [one.id, aside.id]
            with pytest.raises(DaemonError, match="no measurement 'nonsense'"):
                await lab.diagnose(one.id, also=[aside.id, "nonsense"], propose=True)
            await lab.submit_diagnosis(one.id, sweeps, "diagnosis", "1", {"says": ["a cable"]})
            assert await lab.wait_diagnosis(one.id) == {"says": ["a cable"]}

            assert "mine" in {fitter.name for fitter in (await lab.hello("mine", "2")).fitters}
            assert await lab.unanswered("mine") == (one.id,)
            await lab.submit(one.id, sweeps, "mine", "2", "too short")
            await lab.submit(one.id, sweeps, "mine", "3", result)
            assert await lab.unanswered("mine") == ()
            assert {answer.event.fitter for answer in await lab.fits(one.id)} >= {ECHO, "mine", "diagnosis"}

            async with lab.lease("ana", 60.0) as held:
                with pytest.raises(DaemonError, match="the instrument is leased to 'ana'") as refused:
                    await lab.begin(build, "disk")
                assert refused.value.code == "leased"
                assert (await lab.measure(build, "disk", lease=held)).sweeps
            assert (await lab.status()).lease is None
            await lab.bench({"command": "step", "name": "ml1"})
            assert "disk.c33D" in (await lab.bench({"command": "truth"}))["constants"]
            assert (await lab.settings())["fitters"] == [ECHO, "guest_examples:Refuses"]
            assert (await lab.metrics()).counts["refused"] > 0
            with pytest.raises(DaemonError, match="neither runs nor waits"):
                await lab.cancel(one.id)
            await lab.shutdown()

    asyncio.run(asyncio.wait_for(story(), 90))


@pytest.mark.parametrize("client", [blocking, connect_async])
def test_both_clients_report_pruned_events(
    start_daemon,
    build: Build,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    client: Callable[[], AbstractAsyncContextManager[Any]],
) -> None:
    monkeypatch.setattr(event_follower, "SILENCE", 90.0)
    where = start_daemon(**endpoints())

    async def story() -> None:
        holes: list[MissingEvents] = []
        async with client() as lab:
            events = await lab.listen(90, missing=holes.append)
            heard = (await lab.status()).seq
            last = prune_unheard(start_daemon, where, tmp_path, build)
            event = (await anext(events)).event
            assert (event.state, event.seq) == ("started", last + 1)
            assert [(hole.first, hole.last) for hole in holes] == [(heard + 1, last)], "before what came after it"
            says = f"events {heard + 1} to {last} are no longer in the journal: pruned on "
            assert holes[0].sentence.startswith(says)
            await events.aclose()

            holes.clear()
            assert [one.event.seq async for one in lab.replay(1, last + 1, missing=holes.append)] == [last + 1]
            assert [(hole.first, hole.last) for hole in holes] == [(1, last)]
            with pytest.warns(MissingEventsWarning, match=says):
                assert [one async for one in lab.replay(heard + 1, last)] == []

    asyncio.run(asyncio.wait_for(story(), 90))
