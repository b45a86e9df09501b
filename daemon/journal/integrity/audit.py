"""The audit trail: the events that name the client who requested them, hashed and chained like all events."""

from collections.abc import Iterator
from typing import Any

import msgspec

from ...wire.events import SampleStep
from ..store import Store


class AuditEntry(msgspec.Struct, frozen=True, kw_only=True):
    """One action that a client requested."""

    station: str
    seq: int
    """Number of the event, which `verify` checks."""
    time: str
    client: str
    """Name of the client's key, as given to `pzctl keys client`; `local` for the daemon's own account."""
    by: str | None
    """The user for whom the client asked, as the client states; the page's user."""
    did: str
    """`queued`, `cancelling`, `bench`, `leased`, `released`, `withdrawn`, `started`, `shutdown`."""
    measurement: str | None
    sample: SampleStep | None
    says: str


class _StateHeader(msgspec.Struct, frozen=True):
    """The fields of a state event's header; events of earlier versions name no client."""

    time: str
    state: str
    client: str | None = None
    by: str | None = None
    measurement: str | None = None
    sample: SampleStep | None = None
    says: str = ""


def audit_entries(store: Store) -> Iterator[AuditEntry]:
    """Yield the entries of all stations, oldest first for each station. Raises JournalError."""
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
    except msgspec.MsgspecError:  # a changed row, which `verify` reports
        return _StateHeader(time="", state="unreadable", client="unreadable", says="this entry was changed")


_decoder = msgspec.json.Decoder(_StateHeader)
