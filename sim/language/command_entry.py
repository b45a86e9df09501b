"""A line of the command table."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from ..instrument.instrument import Instrument
from .messages import CommandError, Unit

Act: TypeAlias = Callable[[Instrument, Unit], None]
"""What a command does."""

Ask: TypeAlias = Callable[[Instrument, Unit], bytes | str]
"""What a query answers, without its newline."""


@dataclass(frozen=True)
class Entry:
    """One command or query, and how many parameters it takes."""

    run: Callable[[Instrument, Unit], bytes | str | None]
    least: int = 0
    most: int = 0

    def __call__(self, instrument: Instrument, unit: Unit) -> bytes | None:
        """Carry it out; return the answer of a query. Raises CommandError."""
        if len(unit.arguments) < self.least:
            raise CommandError(-109, "MISSING PARAMETER")
        if len(unit.arguments) > self.most:
            raise CommandError(-108, "PARAMETER NOT ALLOWED")
        answer = self.run(instrument, unit)
        return answer.encode("latin-1") if isinstance(answer, str) else answer
