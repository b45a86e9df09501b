"""The instrument's error queue: ten entries, oldest first, each gone once it is read."""

from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection

DEPTH = 10


def drain(link: Connection) -> tuple[replies.QueuedError, ...]:
    """Return what stands in the error queue, oldest first, and leave it empty. Raises InstrumentError."""
    found: list[replies.QueuedError] = []
    for _ in range(DEPTH + 1):
        error = replies.queued_error(link.ask("OUTPERRO?"), f"{link.name}: OUTPERRO?")
        if error.number == 0:
            return tuple(found)
        found.append(error)
    raise InstrumentError(f"{link.name}: the error queue does not get empty; last was {described(found[-1])}")


def check(link: Connection, doing: str) -> None:
    """Raise InstrumentError where the queue holds an error; `doing`: after what it was read."""
    if errors := drain(link):
        raise InstrumentError(f"{link.name}: {doing}, the instrument reports {'; '.join(map(described, errors))}")


def described(error: replies.QueuedError) -> str:
    """Return the error as a person reads it."""
    return f"error {error.number} ({error.text})"
