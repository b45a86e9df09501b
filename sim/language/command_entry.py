"""A line of the command table."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TypeAlias

from ..instrument.instrument import Instrument
from .messages import CommandError, Unit

Act: TypeAlias = Callable[[Instrument, Unit], None]
"""Carries out a command."""

Ask: TypeAlias = Callable[[Instrument, Unit], bytes | str]
"""Returns the answer of a query, without its newline."""


@dataclass(frozen=True)
class Entry:
    """One command or query, and how many parameters it takes."""

    run: Callable[[Instrument, Unit], bytes | str | None]
    minimum: int = 0
    maximum: int = 0

    def __call__(self, instrument: Instrument, unit: Unit) -> bytes | None:
        """Carry it out; return the answer of a query. Raises CommandError."""
        if len(unit.arguments) < self.minimum:
            raise CommandError(-109)
        if len(unit.arguments) > self.maximum:
            raise CommandError(-108)
        answer = self.run(instrument, unit)
        return answer.encode("latin-1") if isinstance(answer, str) else answer
