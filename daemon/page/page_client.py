"""The page's client of the daemon, whose requests name the page's user."""

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
    """A client of the daemon that runs here; `by` is the name of the page's user, or None without a file of users."""

    def __init__(self, by: str | None) -> None:
        """Connect to the daemon. Raises DaemonError if none runs."""
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
