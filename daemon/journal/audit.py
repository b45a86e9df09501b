"""Who did what: the events that name who asked for them, oldest first. Like all events they are hashed and chained."""

from collections.abc import Iterator
from typing import Any

import msgspec

from ..wire.events import SampleStep
from .store import Store


class AuditEntry(msgspec.Struct, frozen=True, kw_only=True):
    """One thing that somebody asked for and that was done."""

    station: str
    seq: int
    """Of the event, which `verify` checks."""
    time: str
    client: str
    """Whose key it was: the name that `pzctl keys client` gave it; `local` for the daemon's own account."""
    by: str | None
    """For whom that client asked, as it said itself; the page's user."""
    did: str
    """`queued`, `cancelling`, `bench`, `leased`, `released`, `withdrawn`, `started`, `shutdown`."""
    measurement: str | None
    sample: SampleStep | None
    says: str


class _StateHeader(msgspec.Struct, frozen=True):
    """What a state event's header says; those of earlier versions name nobody."""

    time: str
    state: str
    client: str | None = None
    by: str | None = None
    measurement: str | None = None
    sample: SampleStep | None = None
    says: str = ""


def audit_entries(store: Store) -> Iterator[AuditEntry]:
    """Yield what was done, of every station. Raises JournalError."""
    sql = "SELECT station, seq, header FROM events WHERE kind = 'state' ORDER BY station, seq"
    with store.snapshot():
        for station, seq, header in store.stream(sql):
            state = _state(header)
            if state.client is not None:
                yield AuditEntry(
                    station=station,
                    seq=seq,
                    time=state.time,
                    client=state.client,
                    by=state.by,
                    did=state.state,
                    measurement=state.measurement,
                    sample=state.sample,
                    says=state.says,
                )


def _state(header: Any) -> _StateHeader:
    try:
        return _decoder.decode(header)
    except msgspec.MsgspecError:  # a row that was changed: `verify` names it
        return _StateHeader(time="", state="unreadable", client="unreadable", says="this entry is not what was written")


_decoder = msgspec.json.Decoder(_StateHeader)
