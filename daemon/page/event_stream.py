"""The stream that passes the daemon's events on to every open page."""

import asyncio
import json
import logging
from collections.abc import AsyncIterator, Callable
from typing import Any

from starlette.responses import JSONResponse, StreamingResponse
from starlette.types import Receive, Scope, Send

from ...models.base.errors import PzctlError
from ..client.async_client import connect_async
from ..wire.events import ReceivedEvent
from ..wire.replies import MissingEvents
from .page_json import event_json

log = logging.getLogger(__name__)

WAITING = 500
"""Greatest number of events that wait for a page; a slower page is disconnected and reconnects by itself."""
MOST_PAGES = 50
"""Greatest number of pages that receive events at the same time."""
AGAIN = 1.0
"""Seconds between attempts to connect to the daemon."""


class EventStream:
    """The daemon's events as they happen, as server-sent events.

    One listener serves all pages. It never delays the acquisition: the daemon drops events that are not read.
    """

    def __init__(self, may_hear: Callable[[Scope], bool] = lambda _: True) -> None:
        """`may_hear` is asked before each event whether an open page may still receive it."""
        self._may_hear = may_hear
        self._pages: set[asyncio.Queue[str | None]] = set()
        self._connected = 0
        self._listener: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Start listening, in the event loop that serves the pages."""
        self._listener = asyncio.create_task(self._listen())

    def stop(self) -> None:
        """End every page's stream and the listener."""
        if self._listener is not None:
            self._listener.cancel()
        for page in self._pages:
            if not page.full():
                page.put_nowait(None)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a page with server-sent events until it is closed or too slow; refuse it if too many are open."""
        if self._connected >= MOST_PAGES:
            says = f"{MOST_PAGES} pages receive the events already; close one, and load this one again"
            await JSONResponse({"error": says}, 503)(scope, receive, send)
            return
        page: asyncio.Queue[str | None] = asyncio.Queue(WAITING)
        self._pages.add(page)
        self._connected += 1
        try:
            stream = _stream(page, lambda: self._may_hear(scope))
            await StreamingResponse(stream, media_type="text/event-stream")(scope, receive, send)
        finally:
            self._pages.discard(page)
            self._connected -= 1

    async def _listen(self) -> None:
        while True:
            try:
                async with connect_async() as lab:
                    events = await lab.listen(missing=self._say_missing)
                    self._say({"kind": "daemon", "there": True})
                    async for received in events:
                        self._spread(await asyncio.to_thread(_text, received))
            except PzctlError as error:
                says = str(error)
            except Exception as error:  # whatever one event raises, the pages must hear the next ones
                log.exception("events")
                says = f"a defect of pzctl, see the page's log: {error!r}"
            else:
                continue
            self._say({"kind": "daemon", "there": False, "says": says})
            await asyncio.sleep(AGAIN)

    def _say_missing(self, missing: MissingEvents) -> None:
        self._say({"kind": "missing", "says": missing.sentence})

    def _say(self, event: dict[str, Any]) -> None:
        self._spread(json.dumps(event))

    def _spread(self, text: str) -> None:
        for page in [*self._pages]:
            if page.full():
                self._pages.discard(page)
                page.get_nowait()
                page.put_nowait(None)
            else:
                page.put_nowait(text)


async def _stream(page: "asyncio.Queue[str | None]", may_hear: Callable[[], bool]) -> AsyncIterator[str]:
    yield "retry: 1000\n\n"
    while (text := await page.get()) is not None and may_hear():
        yield f"data: {text}\n\n"


def _text(received: ReceivedEvent) -> str:
    """Return an event as JSON text for the pages, which takes a while for a long sweep."""
    return json.dumps(event_json(received))
