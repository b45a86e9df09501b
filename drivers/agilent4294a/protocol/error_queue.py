"""The instrument's error queue: ten entries, oldest first; reading an entry removes it."""

import re
from dataclasses import dataclass

from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection

DEPTH = 10

_ERROR = re.compile(r' ?([+-]?\d{1,6}),"?([^"]*)"?', re.ASCII)


@dataclass(frozen=True)
class QueuedError:
    """One entry of the instrument's error queue."""

    number: int
    """0 where the queue is empty."""
    text: str


def queued_error(text: str, what: str) -> QueuedError:
    """Return the error that `OUTPERRO?` answered: `<number>,<text>`. Raises InstrumentError."""
    found = _ERROR.fullmatch(text)
    if not found:
        raise InstrumentError(f"{what}: the answer is {replies.quote(text)}; <number>,<text> is expected")
    return QueuedError(int(found[1]), found[2])


def drain(link: Connection) -> tuple[QueuedError, ...]:
    """Return the entries of the error queue, oldest first, and leave it empty. Raises InstrumentError."""
    found: list[QueuedError] = []
    for _ in range(DEPTH + 1):
        error = queued_error(link.ask("OUTPERRO?"), f"{link.name}: OUTPERRO?")
        if error.number == 0:
            return tuple(found)
        found.append(error)
    raise InstrumentError(f"{link.name}: the error queue does not get empty; last was {described(found[-1])}")


def check(link: Connection, doing: str) -> None:
    """Raise InstrumentError where the queue holds an error; `doing` names the preceding action."""
    if errors := drain(link):
        raise InstrumentError(f"{link.name}: {doing}, the instrument reports {'; '.join(map(described, errors))}")


def described(error: QueuedError) -> str:
    """Return the error as readable text."""
    return f"error {error.number} ({error.text})"
