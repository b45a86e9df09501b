"""The DC bias source: switched on with the smallest sufficient current range, and verified."""

from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection
from . import error_queue as errorqueue
from . import settings

RANGES = ("M1", "M10", "M100")
"""1, 10 and 100 mA. A smaller range sets the voltage more exactly; a larger one can supply a leakier device."""

RANGE_TOO_SMALL = 137
"""The error of `DCO ON` where the bias needs more current than the range supplies."""


def switch_on(link: Connection, volts: float) -> str:
    """Put `volts` (-40 to 40 V) across the device in constant-voltage mode; return the range that was needed.

    Ranges are tried from the smallest. Raises InstrumentError where none is sufficient; the bias is then off.
    """
    settings.put(link, "DCMOD", "CVOLT")
    for current_range in RANGES:
        settings.put(link, "DCRNG", current_range)
        settings.put(link, "DCV", volts)
        on = replies.flag(link.ask("DCO ON;DCO?"), f"{link.name}: bias (DCO?)")
        errors = errorqueue.drain(link)
        if on and not errors:
            return current_range
        settings.put(link, "DCO", False)
        if any(error.number != RANGE_TOO_SMALL for error in errors) or not errors:
            told = "; ".join(map(errorqueue.described, errors)) or "no error"
            raise InstrumentError(f"{link.name}: the DC bias of {volts:g} V did not come on; reported: {told}")
    raise InstrumentError(
        f"{link.name}: the DC bias of {volts:g} V needs more than 100 mA (error {RANGE_TOO_SMALL}); "
        "is the device short-circuited?"
    )
