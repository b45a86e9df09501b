"""Hears the daemon's events in a thread and passes them on to every open page."""

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable
from typing import Any

from starlette.responses import JSONResponse, StreamingResponse
from starlette.types import Receive, Scope, Send

from ..client.client import connect
from ..client.connection import DaemonError
from .page_json import event_json

WAITING = 500
"""Events that wait for a page; one that is slower is let go, and comes back by itself."""
MOST_PAGES = 50
"""Pages that may hear at once."""
AGAIN = 1.0
"""Seconds until a daemon that has gone is looked for again."""


class EventStream:
    """One listener for any number of pages. Acquisition does not wait for it: the daemon drops what is not read."""

    def __init__(self, may_hear: Callable[[Scope], bool] = lambda _: True) -> None:
        """`may_hear` says of an open page, at each event, whether it may still hear."""
        self._may_hear = may_hear
        self._pages: set[asyncio.Queue[str | None]] = set()
        self._connected = 0
        self._stop = threading.Event()
        self._loop: asyncio.AbstractEventLoop | None = None

    def start(self) -> None:
        """Begin to listen, from within the loop that serves the pages."""
        self._loop = asyncio.get_running_loop()
        threading.Thread(target=self._listen, name="events", daemon=True).start()

    def stop(self) -> None:
        """End every page's stream and the listener."""
        self._stop.set()
        for page in self._pages:
            if not page.full():
                page.put_nowait(None)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a page with server-sent events until it is closed or too slow, or that there are enough of them."""
        if self._connected >= MOST_PAGES:
            says = f"{MOST_PAGES} pages hear the events already; close one, and load this one again"
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

    def _listen(self) -> None:
        while not self._stop.is_set():
            try:
                with connect() as lab:
                    self._say({"kind": "daemon", "there": True})
                    while not self._stop.is_set():
                        for heard in lab.listen(0.5):
                            self._say(event_json(heard))
            except DaemonError as error:
                self._say({"kind": "daemon", "there": False, "says": str(error)})
                self._stop.wait(AGAIN)

    def _say(self, event: dict[str, Any]) -> None:
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._spread, json.dumps(event))

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
