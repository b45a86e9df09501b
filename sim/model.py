"""The analyzers that can be simulated: their identification and their command language."""

from collections.abc import AsyncIterator, Callable, Mapping
from dataclasses import dataclass

from .instrument.instrument import FIRMWARE, Instrument
from .instrument.status import USER_REQUEST
from .language import dialect
from .language.messages import CommandError, Unit, parse
from .scpi import e4990a


@dataclass(frozen=True)
class Model:
    """One analyzer."""

    identity: str
    """The answer to `*IDN?`, containing `{serial}`."""
    execute: Callable[[Instrument, Unit], bytes | None]
    """Carries out one unit; errors go to the error queue."""
    perform: Callable[[Instrument, bytes, Callable[[], bool]], AsyncIterator[bytes]]
    """Carries out a message; yields the answers."""
    set_initial: Callable[[Instrument], None]
    """Called after every reset."""

    def panel(self, instrument: Instrument, message: bytes) -> None:
        """Carry out the commands of a message as a person at the front panel does, and set the user-request bit."""
        instrument.status.raise_standard(USER_REQUEST)
        try:
            for unit in parse(message):
                self.execute(instrument, unit)
        except CommandError as error:
            instrument.status.error(error)


MODELS: Mapping[str, Model] = {
    "4294A": Model(f"HEWLETT-PACKARD,4294A,{{serial}},{FIRMWARE}", dialect.execute, dialect.perform, lambda _: None),
    "E4990A": Model(e4990a.IDENTITY, e4990a.execute, e4990a.perform, e4990a.set_initial),
}
"""By the names that `pzctl sim --model` takes."""
