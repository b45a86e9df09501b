"""Saves the instrument's settings before a measurement and restores them afterwards.

Not everything is restored. The bias stays off, even if it was on: it may have been meant for a device that is no longer
in the jig. The output format has no query; it is set to FORM4, the power-on default. The event enable register is set
to 0, also the power-on value.
"""

from collections.abc import Mapping
from dataclasses import dataclass

from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection
from . import settings

NOT_RESTORED = ("DCO",)
STILL_BIASED = "{}: the DC bias is still ON after DCO OFF; switch it off at the front panel"


@dataclass(frozen=True)
class SavedState:
    """The state in which the instrument was found."""

    continuous: bool
    """Whether it was sweeping continuously."""
    values: Mapping[str, settings.Value]
    of_frequency: Mapping[str, settings.Value]
    """Sweep type and range of frequency sweeps where something else was swept: each sweep parameter has its own."""
    level_V: settings.Value | None
    """The oscillator's voltage where it was set to a current: each mode has its own level."""


def take(link: Connection) -> SavedState:
    """Stop the sweep (HOLD) and return the state of the instrument. Raises InstrumentError."""
    continuous = replies.flag(link.ask("CONT?"), f"{link.name}: CONT?")
    if replies.flag(link.ask("HOLD;CONT?"), f"{link.name}: CONT?"):
        raise InstrumentError(f"{link.name}: it goes on sweeping after HOLD")
    sweep_type = settings.query(link, "SWPT")
    if sweep_type == "LIST":  # in list mode STAR, POIN ... refer to a segment, not to the sweep
        settings.put(link, "SWPT", "LIN")
    values = settings.snapshot(link, settings.SETTINGS) | {"SWPT": sweep_type}
    of_frequency: dict[str, settings.Value] = {}
    if values["SWPP"] != "FREQ":
        settings.put(link, "SWPP", "FREQ")
        of_frequency = settings.snapshot(link, ("SWPT", "STAR", "STOP"))
    level_V: settings.Value | None = None
    if values["POWMOD"] == "CURR":
        settings.put(link, "POWMOD", "VOLT")
        level_V = settings.query(link, "POWE")
    return SavedState(continuous, values, of_frequency, level_V)


def bias_off(link: Connection) -> None:
    """Stop the sweep, switch the bias off, and verify it. Raises InstrumentError."""
    if replies.flag(link.ask("HOLD;DCO OFF;DCO?"), f"{link.name}: bias (DCO?)"):
        raise InstrumentError(STILL_BIASED.format(link.name))


def give_back(link: Connection, found: SavedState, resume: bool) -> None:
    """Restore everything that differs from `found`; with `resume`, continue sweeping if it was.

    A setting that another depends on comes first, and both ends of a range are sent once without verification, so that
    neither moves the other afterwards. Raises InstrumentError where a setting cannot be restored.
    """
    link.ask("FORM4;ESNB 0;*SRE 0;*ESE 0;*STB?")
    if found.level_V is not None:
        _set_back(link, {"POWMOD": "VOLT", "POWE": found.level_V})
    if found.of_frequency:
        _set_back(link, {"SWPP": "FREQ", **found.of_frequency})
    wanted = {name: value for name, value in found.values.items() if name not in NOT_RESTORED}
    in_list = wanted["SWPT"] == "LIST"
    if in_list:
        wanted["SWPT"] = "LIN"
    _set_back(link, wanted)
    if in_list:
        settings.put(link, "SWPT", "LIST")
    if resume and found.continuous and not replies.flag(link.ask("CONT;CONT?"), f"{link.name}: CONT?"):
        raise InstrumentError(f"{link.name}: it does not go on sweeping after CONT")


def _set_back(link: Connection, wanted: Mapping[str, settings.Value]) -> None:
    """Set what differs. Raises InstrumentError where a setting cannot be restored."""
    for name, value in wanted.items():
        if settings.query(link, name) == value:
            continue
        if name == "STAR":
            start, stop = settings.text_of(value), settings.text_of(wanted["STOP"])
            link.ask(f"STAR {start};STOP {stop};STAR?")
        settings.put(link, name, value)
