"""The lease of the instrument, which gives one owner exclusive use until it is returned or expires."""

import time
from collections.abc import Callable, Generator
from contextlib import contextmanager
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
    """The current lease, if any; it expires by a monotonic clock."""

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self._clock = clock
        self._held: _Held | None = None

    @property
    def holder(self) -> LeaseState | None:
        """The owner and the end of the lease, or None if the instrument is not leased."""
        if self._held is not None and self._clock() >= self._held.ends:
            self._held = None
        return self._held.state if self._held else None

    def take(self, client: str, owner: str, seconds: float, lease: str | None, *, busy: bool) -> tuple[str, LeaseState]:
        """Take a lease, or extend `lease`; return its id and its state. It is valid for this client's key only.

        Raises RequestError if the instrument is leased to another owner or is `busy`.
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
        """Return the lease. Raises RequestError if this client has no lease with this id."""
        self._own(client, lease)
        self._held = None

    @contextmanager
    def undone_on_error(self) -> Generator[None]:
        """Let everything inside change the lease only if it succeeds."""
        held = self._held
        try:
            yield
        except BaseException:
            self._held = held
            raise

    def check(self, client: str, lease: str | None) -> None:
        """Raise RequestError if the instrument is leased under another id."""
        self.check_client(client)
        if self.holder is not None and self._held is not None and lease != self._held.lease:
            raise self._leased(self.holder)

    def check_client(self, client: str) -> None:
        """Raise RequestError if another client has the lease; only its holder may cancel and glue."""
        if self.holder is not None and self._held is not None and client != self._held.client:
            raise self._leased(self.holder)

    @staticmethod
    def _leased(holder: LeaseState) -> RequestError:
        return RequestError(
            "leased",
            f"the instrument is leased to {holder.owner!r} until {holder.until}",
            "wait until the lease is returned or expires",
        )

    def is_of(self, client: str, lease: str) -> bool:
        """Return whether this client has the lease with this id."""
        current = self._held
        return self.holder is not None and current is not None and (current.client, current.lease) == (client, lease)

    def _own(self, client: str, lease: str) -> None:
        if not self.is_of(client, lease):
            raise RequestError("no-such-lease", "this lease has expired, was returned, or never existed")
