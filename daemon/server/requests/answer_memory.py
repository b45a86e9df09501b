"""The memory of answered requests, so that one that is sent again gets the same answer and is not carried out again."""

import asyncio
from collections import OrderedDict
from dataclasses import dataclass, field
from typing import TypeAlias

REMEMBERED = 1000
"""Number of answers of each kind to keep for each client."""

Said: TypeAlias = "list[bytes] | asyncio.Future[list[bytes]]"
"""The frames of an answer, now or later."""


@dataclass(frozen=True)
class GivenAnswer:
    """An answer that was given, and the hash of its request."""

    digest: bytes
    said: Said


@dataclass
class _OfClient:
    """The answers to one client, by request id; its refused requests do not displace those that were carried out."""

    accepted: OrderedDict[str, GivenAnswer] = field(default_factory=OrderedDict[str, GivenAnswer])
    refused: OrderedDict[str, GivenAnswer] = field(default_factory=OrderedDict[str, GivenAnswer])


class AnswerMemory:
    """The latest answers to each client. There are as many clients as keys, so that nobody can add any."""

    def __init__(self) -> None:
        self._clients: dict[str, _OfClient] = {}

    def given(self, client: str, request: str) -> GivenAnswer | None:
        """Return the answer to the client's request with this id, or None."""
        of = self._of(client)
        return of.accepted.get(request) or of.refused.get(request)

    def keep(self, client: str, request: str, answer: GivenAnswer, *, refused: bool) -> None:
        """Remember an answer, and forget the client's oldest one of the same kind if there are too many."""
        of = self._of(client)
        kept = of.refused if refused else of.accepted
        kept[request] = answer
        if len(kept) > REMEMBERED:
            kept.popitem(last=False)

    def refuse(self, client: str, request: str, *, for_good: bool) -> None:
        """Note that a request whose answer was to come later was refused; forget it if a repetition may succeed."""
        answer = self._of(client).accepted.pop(request, None)
        if answer is not None and for_good:
            self.keep(client, request, answer, refused=True)

    def _of(self, client: str) -> _OfClient:
        return self._clients.setdefault(client, _OfClient())
