"""Waiting for an instrument's service request (the SRQ line of GPIB).

A vendor's VISA library has an event for it. A Prologix or AR488 adapter answers `++srq` itself, without asking the
instrument. A network socket has no such line (Programming Manual p. 474: SRQ belongs to the GPIB).
"""

import time
from collections.abc import Callable
from typing import Any, cast

from pyvisa import VisaIOError
from pyvisa.constants import EventMechanism, EventType, InterfaceType
from pyvisa.resources import MessageBasedResource

ADAPTER_SECONDS = 0.02
"""Seconds between two queries to an adapter."""

Wait = Callable[[float], None]
"""Wait until service is requested, or for this many seconds; returning early is allowed."""


def waiter(instrument: MessageBasedResource, bridge: MessageBasedResource | None) -> Wait | None:
    """Return a function that waits for a service request of `instrument`, or None if the connection signals none.

    The function raises VisaIOError, OSError or ValueError if the connection is lost.
    """
    if instrument.interface_type != InterfaceType.gpib:
        return None
    if _has_events(instrument):
        return lambda seconds: _for_event(instrument, seconds)
    return None if bridge is None else lambda seconds: _at_adapter(bridge, seconds)


def _has_events(instrument: MessageBasedResource) -> bool:
    try:
        instrument.enable_event(EventType.service_request, EventMechanism.queue)
    except (NotImplementedError, VisaIOError):  # pyvisa-py 0.8 has no events, and some drivers have none for GPIB
        return False
    return True


def _for_event(instrument: MessageBasedResource, seconds: float) -> None:
    instrument.wait_on_event(EventType.service_request, max(1, round(1000 * seconds)), capture_timeout=True)


def _at_adapter(bridge: MessageBasedResource, seconds: float) -> None:
    """Ask the adapter whether SRQ is asserted, without `++read`, as pyvisa-py does for a serial poll."""
    session = cast("Any", bridge.visalib).sessions[bridge.session]
    until = time.monotonic() + seconds
    while True:
        session.write_oob(b"++srq\n")
        answer, _ = session.read(32)
        if answer.strip() != b"0" or time.monotonic() + ADAPTER_SECONDS > until:
            return
        time.sleep(ADAPTER_SECONDS)
