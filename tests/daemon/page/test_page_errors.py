"""The page gets over errors: one event that cannot be shown, one computation that takes too long."""

import asyncio
import threading
from collections.abc import AsyncGenerator, Callable
from concurrent.futures import Future
from contextlib import asynccontextmanager
from types import SimpleNamespace

import pytest
from starlette.requests import Request
from starlette.responses import JSONResponse, Response
from starlette.types import Message

from pzctl.daemon.page import event_stream, page_server
from pzctl.daemon.page.event_stream import EventStream
from pzctl.daemon.page.page_users import PageUser
from pzctl.daemon.page.request_body import NoFields
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


def test_a_measurement_is_cancelled_while_many_diagnoses_are_waited_for() -> None:
    go_on = threading.Event()

    def diagnose(_: NoFields, __: PageUser) -> Response:
        go_on.wait(60)
        return JSONResponse({})

    def cancel(_: NoFields, __: PageUser) -> Response:
        return JSONResponse({})

    async def receive() -> Message:
        return {"type": "http.request", "body": b"{}", "more_body": False}

    def asked() -> Request:
        return Request({"type": "http", "headers": [], "pzctl.user": PageUser(None, "act")}, receive)

    async def told() -> int:
        slow = page_server._command("/api/diagnose", NoFields, diagnose)
        quick = page_server._command("/api/cancel", NoFields, cancel)
        diagnoses = [asyncio.create_task(slow.endpoint(asked())) for _ in range(50)]
        await asyncio.sleep(0.1)
        try:
            async with asyncio.timeout(30):
                return (await quick.endpoint(asked())).status_code
        finally:
            go_on.set()
            await asyncio.wait(diagnoses)

    assert asyncio.run(told()) == 200
