"""One owner of the instrument at a time: a lease that other tools take, give back, or let expire."""

import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from ...wire.replies import LeaseState
from ...wire.uuid7 import uuid7
from ..requests.request_errors import RequestError


@dataclass(frozen=True)
class _Held:
    lease: str
    state: LeaseState
    ends: float


class Lease:
    """Who has the instrument to themselves. Time is measured by a clock that nobody sets back."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._held: _Held | None = None

    @property
    def holder(self) -> LeaseState | None:
        """Who holds it, and until when; None where nobody does."""
        if self._held is not None and self._clock() >= self._held.ends:
            self._held = None
        return self._held.state if self._held else None

    def take(self, owner: str, seconds: float, lease: str | None, *, busy: bool) -> tuple[str, LeaseState]:
        """Take it, or hold `lease` for longer; return its id, which is to be kept to oneself, and its state.

        Raises RequestError where another one holds it, or where the instrument is `busy` for somebody.
        """
        if lease is None:
            self.check(None)
            if busy:
                raise RequestError("busy", "the instrument measures, or measurements wait for it", "ask again later")
        else:
            self._own(lease)
        until = datetime.now(UTC) + timedelta(seconds=seconds)
        state = LeaseState(owner, until.isoformat(timespec="milliseconds").replace("+00:00", "Z"))
        self._held = _Held(lease or uuid7(), state, self._clock() + seconds)
        return self._held.lease, state

    def give_back(self, lease: str) -> None:
        """Give it back. Raises RequestError where it is not held under this id."""
        self._own(lease)
        self._held = None

    def check(self, lease: str | None) -> None:
        """Raise RequestError where somebody else has the instrument to themselves."""
        holder = self.holder
        if holder is not None and self._held is not None and lease != self._held.lease:
            raise RequestError(
                "leased",
                f"{holder.owner!r} has the instrument to itself until {holder.until}",
                "wait until it is given back or expires",
            )

    def _own(self, lease: str) -> None:
        if self.holder is None or self._held is None or self._held.lease != lease:
            raise RequestError("no-such-lease", "this lease has expired, was given back, or never was")
