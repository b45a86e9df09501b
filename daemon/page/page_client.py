"""The page's client of the daemon: every request names the user for whom it asks."""

from collections.abc import Sequence
from typing import TypeVar

import msgspec

from ..client.client import Client
from ..client.connection import PATIENCE, RequestClient
from ..client.location import address
from ..wire.replies import Answer
from ..wire.requests import Request

A = TypeVar("A", bound=Answer)


class PageClient(Client):
    """A client of the daemon that runs here; `by` is the page's user, None where nobody has a name."""

    def __init__(self, by: str | None) -> None:
        """Connect. Raises DaemonError where none runs."""
        events, requests, key = address(None, None, None)
        super().__init__(events, requests, key)
        self._asker.close()
        self._asker = _NamedRequests(self._context, requests, key)
        self._asker.by = by


class _NamedRequests(RequestClient):
    by: str | None = None

    def ask_frames(
        self, request: Request, expected: type[A], raw: Sequence[bytes] = (), patience: float = PATIENCE
    ) -> tuple[A, list[bytes]]:
        return super().ask_frames(msgspec.structs.replace(request, by=self.by), expected, raw, patience)
