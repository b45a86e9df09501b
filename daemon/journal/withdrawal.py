"""Measurements that were withdrawn: marked in the record with who and why, and never removed from it."""

from dataclasses import dataclass

import msgspec

from ...models.base.errors import PzctlError
from ..wire.events import StateEvent
from .journal_reader import JournalReader

WITHDRAWN = "withdrawn"
"""The state of such a measurement."""

_COUNTS = "measured"
"""The state of a measurement that is the record of its step; no other has to be withdrawn."""


class WithdrawalError(PzctlError):
    """A measurement that cannot be withdrawn."""


@dataclass(frozen=True)
class Withdrawal:
    """Who withdrew a measurement, when and why."""

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
    found = journal.measurement(measurement)
    if found is None:
        raise WithdrawalError(f"the journal holds no measurement {measurement!r}")
    if found.state != _COUNTS:
        raise WithdrawalError(f"measurement {measurement!r} is {found.state}; only a {_COUNTS} one can be withdrawn")
    ((station,),) = journal.store.all("SELECT station FROM measurements WHERE id = ?", measurement)
    if station != journal.station:
        raise WithdrawalError(f"measurement {measurement!r} is of station {station!r}; it is withdrawn there")
    return StateEvent(state=WITHDRAWN, says=why, measurement=found.id, sample=found.sample, client=client, by=by)


def withdrawal_of(journal: JournalReader, measurement: str) -> Withdrawal | None:
    """Return who withdrew a measurement, and why; None where nobody did. Raises JournalError."""
    sql = "SELECT header FROM events WHERE measurement = ? AND kind = 'state' ORDER BY station, seq"
    for (header,) in reversed(journal.store.all(sql, measurement)):
        event = msgspec.json.decode(header, type=StateEvent)
        if event.state == WITHDRAWN:
            return Withdrawal(event.by or "", event.client or "", event.time, event.says)
    return None
