"""The page gets over errors: one event that cannot be shown, one computation that takes too long."""

import asyncio
from collections.abc import AsyncGenerator, Callable
from concurrent.futures import Future
from contextlib import asynccontextmanager
from types import SimpleNamespace

import pytest

from pzctl.daemon.page import event_stream
from pzctl.daemon.page.event_stream import EventStream
from pzctl.daemon.page.worker_process import NoAnswer, WorkerProcess


def test_an_event_that_cannot_be_shown_does_not_end_the_stream(monkeypatch: pytest.MonkeyPatch) -> None:
    async def listen(missing: Callable[..., None]) -> AsyncGenerator[str]:
        async def events() -> AsyncGenerator[str]:
            yield "event"

        return events()

    @asynccontextmanager
    async def connected() -> AsyncGenerator[SimpleNamespace]:
        yield SimpleNamespace(listen=listen)

    said: list[str] = []

    def text(event: str) -> str:
        said.append(event)
        if len(said) == 1:
            raise ValueError("not a number")
        return "shown"

    async def heard() -> None:
        stream = EventStream()
        page: asyncio.Queue[str | None] = asyncio.Queue(100)
        stream._pages.add(page)
        stream.start()
        assert stream._listener is not None
        try:
            async with asyncio.timeout(60):
                while await page.get() != "shown":
                    assert not stream._listener.done()
        finally:
            stream.stop()

    monkeypatch.setattr(event_stream, "connect_async", connected)
    monkeypatch.setattr(event_stream, "_text", text)
    monkeypatch.setattr(event_stream, "AGAIN", 0.0)
    asyncio.run(heard())


def test_what_waits_behind_a_computation_that_takes_too_long_gets_no_answer() -> None:
    """Its process is ended, and what waited for it is cancelled."""
    cancelled: Future[None] = Future()
    cancelled.cancel()
    worker = WorkerProcess()
    pool = SimpleNamespace(submit=lambda *_: cancelled, shutdown=lambda **_: None)
    worker._pool = pool  # type: ignore[assignment]
    with pytest.raises(NoAnswer):
        worker.ask(print)
