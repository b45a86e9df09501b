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
    client: str
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

    def take(self, client: str, owner: str, seconds: float, lease: str | None, *, busy: bool) -> tuple[str, LeaseState]:
        """Take it, or hold `lease` for longer; return its id and its state. It is of use to this client's key alone.

        Raises RequestError where another one holds it, or where the instrument is `busy` for somebody.
        """
        if lease is None:
            self.check(client, None)
            if busy:
                raise RequestError("busy", "the instrument measures, or measurements wait for it", "ask again later")
        else:
            self._own(client, lease)
        until = datetime.now(UTC) + timedelta(seconds=seconds)
        state = LeaseState(owner, until.isoformat(timespec="milliseconds").replace("+00:00", "Z"))
        self._held = _Held(client, lease or uuid7(), state, self._clock() + seconds)
        return self._held.lease, state

    def give_back(self, client: str, lease: str) -> None:
        """Give it back. Raises RequestError where it is not held under this id, by this client."""
        self._own(client, lease)
        self._held = None

    def check(self, client: str, lease: str | None) -> None:
        """Raise RequestError where somebody else has the instrument to themselves."""
        self.check_client(client)
        if self.holder is not None and self._held is not None and lease != self._held.lease:
            raise self._leased(self.holder)

    def check_client(self, client: str) -> None:
        """Raise RequestError where another client's key has the instrument: it cancels and glues, nobody else."""
        if self.holder is not None and self._held is not None and client != self._held.client:
            raise self._leased(self.holder)

    @staticmethod
    def _leased(holder: LeaseState) -> RequestError:
        return RequestError(
            "leased",
            f"{holder.owner!r} has the instrument to itself until {holder.until}",
            "wait until it is given back or expires",
        )

    def _own(self, client: str, lease: str) -> None:
        held = self._held
        if self.holder is None or held is None or (held.client, held.lease) != (client, lease):
            raise RequestError("no-such-lease", "this lease has expired, was given back, or never was")
