"""Waits for the end of a sweep, with progress and cancellation.

`*OPC?` alone blocks the instrument's parser until the sweep is over, so that nothing could be cancelled. Therefore the
status byte is polled until it shows the sweep's own event, by serial poll on GPIB and by `*STB?` elsewhere; then
`*OPC?` confirms. On GPIB the same bit raises SRQ; where the connection supports it, the wait between two polls ends
with SRQ. Programming Manual p.474-480: bit 0 of the instrument event register, enabled by `ESNB 1`, is summarised in
bit 2 of the status byte; `*CLS` clears it, so it must come before the sweep.
"""

import time
from collections.abc import Callable

from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection
from .. import sweep_time
from . import error_queue as errorqueue

EVENT = 0b100
"""Bit 2 of the status byte: the enabled instrument event."""

REFUSAL = 0b100000
"""Bit 5: an enabled standard event; only errors are enabled (`*ESE 60`)."""

SWEEP_END = 1
"""Bit 0 of the instrument event register: a single sweep, or a number of them, is complete."""
STANDARD_END = 256
"""Bit 8: a standard of calibration or compensation has been measured."""

ERRORS = 0b111100
"""Bits 2 to 5 of the standard event register: query, device, execution and command error."""
POWER_ON = 0b10000000

SLOWEST_POLL_SECONDS = 0.25
FASTEST_POLL_SECONDS = 0.005


def start(link: Connection, command: str) -> None:
    """Start a sweep by `command` (`SING`, `NUMG 4` ...).

    Raises InstrumentError where it is refused.
    """
    events = replies.integer(link.ask(f"ESNB {SWEEP_END};*SRE 4;*CLS;{command};*ESR?"), f"{link.name}: *ESR?")
    if events & ERRORS:
        errorqueue.check(link, f"after {command}")
        raise InstrumentError(f"{link.name}: {command} was refused (event status register {events})")


def measure_standard(link: Connection, command: str, seconds: float, tick: Callable[[float], None], what: str) -> None:
    """Send the command that measures a standard (`COMA` ...), and return when it is measured; it should take `seconds`.

    It is not an overlapped command (Programming Manual p.262): the instrument may not answer until it is done. So the
    wait for the status byte lasts as long as the standard may take; its bit 5 shows a refusal. `tick`: see `finish`.
    """
    link.ask(f"*ESE {ERRORS};ESNB {STANDARD_END};*SRE {EVENT | REFUSAL};*CLS;*ESR?")
    link.tell(command)
    begun, limit = time.monotonic(), sweep_time.timeout(seconds)
    while True:
        passed = time.monotonic() - begun
        status = link.status_byte_patiently(limit - passed, lambda more, before=passed: tick(before + more))
        if status & (EVENT | REFUSAL):
            break
        if passed > limit:
            late = f"did not end within {limit:.0f} s; {seconds:.0f} s were expected"
            raise InstrumentError(f"{link.name}: {what} {late}")
        tick(passed)
        link.rest(_pause(link, passed))
    _check_end(link, what)


def finish(link: Connection, seconds: float, tick: Callable[[float], None], what: str) -> None:
    """Return when the sweep is over; it should take `seconds`.

    `tick` is called several times a second with the elapsed seconds, and may raise to cancel.
    Raises InstrumentError where the sweep does not end in time, or where errors occurred.
    """
    begun = time.monotonic()
    limit = sweep_time.timeout(seconds)
    while not link.status_byte() & EVENT:
        passed = time.monotonic() - begun
        if passed > limit:
            late = f"did not end within {limit:.0f} s; {seconds:.0f} s were expected"
            raise InstrumentError(f"{link.name}: {what} {late}")
        tick(passed)
        link.rest(_pause(link, passed))
    _check_end(link, what)


def _pause(link: Connection, passed: float) -> float:
    """Return the seconds until the next poll: longer where the connection signals the end by itself."""
    blind = min(SLOWEST_POLL_SECONDS, max(FASTEST_POLL_SECONDS, passed / 10))
    return SLOWEST_POLL_SECONDS if link.hears_requests else blind


def _check_end(link: Connection, what: str) -> None:
    """Raise InstrumentError where the sweep did not end well: answers out of step, switched off meanwhile, errors."""
    if (answer := link.ask("*OPC?")) not in ("1", "+1"):
        raise InstrumentError(f"{link.name}: *OPC? is answered by {replies.quote(answer)}; 1 is expected")
    events = replies.integer(link.ask("*ESR?"), f"{link.name}: *ESR?")
    if events & POWER_ON:
        raise InstrumentError(f"{link.name}: the instrument was switched off and on while {what} ran")
    errorqueue.check(link, f"after {what}")
