"""Hears the daemon's events and passes them on to every open page."""

import asyncio
import json
from collections.abc import AsyncIterator
from typing import Any

from ...models.base.errors import PzctlError
from ..client.async_client import connect_async
from ..wire.events import ReceivedEvent
from ..wire.replies import MissingEvents
from .page_json import event_json

WAITING = 500
"""Events that wait for a page; one that is slower is let go, and comes back by itself."""
AGAIN = 1.0
"""Seconds until a daemon that has gone is looked for again."""


class EventStream:
    """One listener for any number of pages. Acquisition does not wait for it: the daemon drops what is not read."""

    def __init__(self) -> None:
        self._pages: set[asyncio.Queue[str | None]] = set()
        self._listener: asyncio.Task[None] | None = None

    def start(self) -> None:
        """Begin to listen, from within the loop that serves the pages."""
        self._listener = asyncio.create_task(self._listen())

    def stop(self) -> None:
        """End every page's stream and the listener."""
        if self._listener is not None:
            self._listener.cancel()
        for page in self._pages:
            if not page.full():
                page.put_nowait(None)

    async def stream(self) -> AsyncIterator[str]:
        """Yield server-sent events until the page is closed or too slow."""
        page: asyncio.Queue[str | None] = asyncio.Queue(WAITING)
        self._pages.add(page)
        try:
            yield "retry: 1000\n\n"
            while (text := await page.get()) is not None:
                yield f"data: {text}\n\n"
        finally:
            self._pages.discard(page)

    async def _listen(self) -> None:
        while True:
            try:
                async with connect_async() as lab:
                    events = await lab.listen(missing=self._say_missing)
                    self._say({"kind": "daemon", "there": True})
                    async for heard in events:
                        self._spread(await asyncio.to_thread(_text, heard))
            except PzctlError as error:
                self._say({"kind": "daemon", "there": False, "says": str(error)})
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


def _text(heard: ReceivedEvent) -> str:
    """Return an event as the pages read it; a long sweep takes a while."""
    return json.dumps(event_json(heard))
