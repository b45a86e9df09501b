"""Withdrawn measurements, which stay in the journal with the name of the person and the reason."""

from dataclasses import dataclass

import msgspec

from ...models.base.errors import PzctlError
from ..wire.events import StateEvent
from .journal_reader import JournalReader
from .stores.event_rows import WITHDRAWN

_COUNTS = "measured"
"""The state of a complete measurement of its step; only such a measurement can be withdrawn."""


class WithdrawalError(PzctlError):
    """The measurement cannot be withdrawn."""


@dataclass(frozen=True)
class Withdrawal:
    """The withdrawal of a measurement: by whom, when and why."""

    by: str
    client: str
    time: str
    why: str

    @property
    def says(self) -> str:
        """A sentence for people."""
        return f"withdrawn by {self.by} on {self.time[:10]}: {self.why}"


def withdrawal_event(journal: JournalReader, measurement: str, why: str, client: str, by: str) -> StateEvent:
    """Return the event that withdraws a measurement of this station. Raises WithdrawalError, JournalError."""
    known = journal.measurement(measurement)
    if known is None:
        raise WithdrawalError(f"the journal holds no measurement {measurement!r}")
    if known.state != _COUNTS:
        raise WithdrawalError(f"measurement {measurement!r} is {known.state}; only a {_COUNTS} one can be withdrawn")
    ((station,),) = journal.store.all("SELECT station FROM measurements WHERE id = ?", measurement)
    if station != journal.station:
        raise WithdrawalError(f"measurement {measurement!r} belongs to station {station!r}; withdraw it there")
    return StateEvent(state=WITHDRAWN, says=why, measurement=known.id, sample=known.sample, client=client, by=by)


def withdrawal_of(journal: JournalReader, measurement: str) -> Withdrawal | None:
    """Return the withdrawal of a measurement, or None if there is none. Raises JournalError."""
    sql = "SELECT header FROM events WHERE measurement = ? AND kind = 'state' ORDER BY station, seq"
    for (header,) in reversed(journal.store.all(sql, measurement)):
        event = msgspec.json.decode(header, type=StateEvent)
        if event.state == WITHDRAWN:
            return Withdrawal(event.by or "", event.client or "", event.time, event.says)
    return None
