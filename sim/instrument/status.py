"""Error queue and status registers (reference 2.7 and 3; PM p.474-480)."""

from collections import deque
from dataclasses import dataclass, field

from ..language.messages import CommandError

QUEUE_DEPTH = 10

OPC, REQUEST_CONTROL, QUERY_ERROR, DEVICE_ERROR, EXECUTION_ERROR, COMMAND_ERROR, USER_REQUEST, POWER_ON = (
    1 << bit for bit in range(8)
)
"""Bits of the Standard Event Status Register."""

SWEEP_DONE, TRIGGER_WAITING, ENTRY_DONE, CORRECTION_DONE = 1, 2, 4, 256
LIMIT_FAIL = {"A": 16, "B": 8}
SEARCH_FAIL = {"A": 64, "B": 32}
POINT_DONE = 128
"""Bits of the Instrument Event Status Register."""

INSTRUMENT_SUMMARY, MESSAGE_AVAILABLE, STANDARD_SUMMARY, MASTER_SUMMARY = 4, 16, 32, 64
"""Bits of the status byte."""


def event_bit(number: int) -> int:
    """Return the bit of the Standard ESR that an error of this number sets (PM p.479)."""
    if -200 < number <= -100:
        return COMMAND_ERROR
    if -300 < number <= -200:
        return EXECUTION_ERROR
    if -500 < number <= -400:
        return QUERY_ERROR
    return DEVICE_ERROR


@dataclass
class Status:
    """The registers. Reading an event register clears it."""

    errors: deque[CommandError] = field(default_factory=deque[CommandError])
    standard: int = POWER_ON
    instrument: int = 0
    standard_enable: int = 0
    instrument_enable: int = 0
    request_enable: int = 0
    requested: bool = False
    """RQS: a service request that no serial poll has taken yet."""

    def error(self, error: CommandError) -> None:
        """Put an error into the queue and set its bit; the eleventh is lost and the last says so."""
        if len(self.errors) < QUEUE_DEPTH:
            self.errors.append(error)
        else:
            self.errors[-1] = CommandError(-350)
        self.raise_standard(event_bit(error.number))

    def next_error(self) -> str:
        """Remove and return the oldest error as `number,"text"`; number 0 where there is none."""
        return str(self.errors.popleft()) if self.errors else '0,"No error"'

    def raise_standard(self, bits: int) -> None:
        """Set bits of the Standard ESR."""
        self._transition(standard=bits)

    def raise_instrument(self, bits: int) -> None:
        """Set bits of the Instrument Event Status Register."""
        self._transition(instrument=bits)

    def _transition(self, standard: int = 0, instrument: int = 0) -> None:
        before = self.byte() & MASTER_SUMMARY
        self.standard |= standard
        self.instrument |= instrument
        if not before and self.byte() & MASTER_SUMMARY:
            self.requested = True

    def answer_waits(self) -> None:
        """Note that an answer entered an empty output queue: service is requested where bit 4 is enabled."""
        if self.request_enable & MESSAGE_AVAILABLE:
            self.requested = True

    def byte(self, message_available: bool = False) -> int:
        """Return the status byte as `*STB?` answers it, bit 6 being the master summary."""
        value = INSTRUMENT_SUMMARY if self.instrument & self.instrument_enable else 0
        value |= STANDARD_SUMMARY if self.standard & self.standard_enable else 0
        value |= MESSAGE_AVAILABLE if message_available else 0
        return value | (MASTER_SUMMARY if value & self.request_enable & ~MASTER_SUMMARY else 0)

    def serial_poll(self, message_available: bool = False) -> int:
        """Return the status byte as a serial poll gives it, bit 6 being RQS, and take the request."""
        value = self.byte(message_available) & ~MASTER_SUMMARY | (MASTER_SUMMARY if self.requested else 0)
        self.requested = False
        return value

    def take_standard(self) -> int:
        """Return the Standard ESR and clear it."""
        value, self.standard = self.standard, 0
        return value

    def take_instrument(self) -> int:
        """Return the Instrument Event Status Register and clear it."""
        value, self.instrument = self.instrument, 0
        return value

    def clear(self) -> None:
        """`*CLS`: clear error queue, event registers and service request; the enable registers stay."""
        self.errors.clear()
        self.standard = self.instrument = 0
        self.requested = False
