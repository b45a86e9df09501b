"""The page's client of the daemon: every request names the user for whom it asks."""

from collections.abc import Sequence
from typing import TypeVar

import msgspec

from ..client.client import Client
from ..client.conversations import Conversations
from ..client.location import address
from ..client.protocol import PATIENCE, Conversation
from ..wire.replies import Answer
from ..wire.requests import Request

A = TypeVar("A", bound=Answer)


class PageClient(Client):
    """A client of the daemon that runs here; `by` is the page's user, None where nobody has a name."""

    def __init__(self, by: str | None) -> None:
        """Connect. Raises DaemonError where none runs."""
        events, requests, key = address(None, None, None)
        super().__init__(events, requests, key)
        self.conversations = _NamedConversations(events, requests)
        self.conversations.by = by


class _NamedConversations(Conversations):
    by: str | None = None

    def answer_to(
        self, request: Request, expected: type[A], raw: Sequence[bytes] = (), patience: float = PATIENCE
    ) -> Conversation[A]:
        return super().answer_to(msgspec.structs.replace(request, by=self.by), expected, raw, patience)
