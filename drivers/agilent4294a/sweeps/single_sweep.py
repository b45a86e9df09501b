"""One sweep of a 4294A: set up, start, wait, read; all numbers come from the same sweep."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Frequencies, Impedances
from ....models.sweep import now_utc
from ....models.sweep_plan import Segment, SweepPlan
from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection
from .. import sweep_time
from ..protocol import bias, settings
from ..protocol import error_queue as errorqueue
from ..protocol import sweep_wait as wait
from . import grid


@dataclass(frozen=True, eq=False)
class RawSweep:
    """The data of one sweep."""

    frequency: Frequencies
    """Hz, shape (N,), rising."""
    impedance: Impedances
    """ohm, shape (N,)."""
    started: str
    """RFC 3339, UTC."""
    ended: str
    seconds: float
    settings: Mapping[str, settings.Value]
    """Settings as read back, by mnemonic."""


def expected_seconds(segment: Segment, plan: SweepPlan) -> float:
    """Return the seconds one sweep of `segment` will take."""
    return sweep_time.estimated(
        grid.points(segment),
        plan.bandwidth,
        plan.point_average,
        plan.sweep_average,
        plan.point_delay_s,
        plan.sweep_delay_s,
    )


@dataclass(frozen=True)
class Run:
    """Start and end of a sweep."""

    started: str
    """RFC 3339, UTC."""
    ended: str
    seconds: float


def sweep(link: Connection, segment: Segment, plan: SweepPlan, tick: Callable[[float], None]) -> RawSweep:
    """Sweep `segment` as `plan` says; `tick`: see `sweep_wait.finish`. Raises InstrumentError or what `tick` raises."""
    asked = wanted(segment, plan)
    set_up(link, asked)
    if plan.bias_V:
        asked |= {"DCO": True, "DCV": plan.bias_V}
        bias.switch_on(link, plan.bias_V)
    before = settings.snapshot(link, settings.SETTINGS | settings.CONDITIONS)
    settings.compare(link, asked, before, "was changed before the sweep")
    errorqueue.check(link, "after the set-up")
    tick(0.0)
    ran = run(link, plan, expected_seconds(segment, plan), tick)
    frequency, impedance = read(link, grid.points(segment))
    check_untouched(link, before)
    return RawSweep(frequency, impedance, ran.started, ran.ended, ran.seconds, before)


def run(link: Connection, plan: SweepPlan, expected: float, tick: Callable[[float], None]) -> Run:
    """Sweep with the present settings, as often as `plan` averages; it should take `expected` seconds.

    Raises InstrumentError, and what `tick` raises.
    """
    started, begun = now_utc(), time.monotonic()
    wait.start(link, f"AVERREST;NUMG {plan.sweep_average}" if plan.sweep_average > 1 else "SING")
    wait.finish(link, expected, tick, "the sweep")
    return Run(started, now_utc(), time.monotonic() - begun)


def wanted(segment: Segment, plan: SweepPlan) -> dict[str, settings.Value]:
    """Return the settings for `segment`, by mnemonic, in the order of setting."""
    return {
        "DCO": False,
        "TRGS": "INT",
        "SWPP": "FREQ",
        "SWPT": "LOG" if segment.spacing == "log" else "LIN",
        "STAR": segment.start_Hz,
        "STOP": segment.stop_Hz,
        "POIN": segment.points,
        "SWED": "DOWN" if plan.direction == "down" else "UP",
        "SDELT": plan.sweep_delay_s,
        "PDELT": plan.point_delay_s,
        "BWFACT": plan.bandwidth,
        "PAVERFACT": plan.point_average,
        "PAVER": plan.point_average > 1,
        "AVERFACT": plan.sweep_average,
        "AVER": plan.sweep_average > 1,
        "POWMOD": "VOLT" if plan.oscillator_A is None else "CURR",
        "POWE": plan.oscillator_V if plan.oscillator_A is None else plan.oscillator_A,
    }


def set_up(link: Connection, asked: Mapping[str, settings.Value]) -> None:
    """Set everything `asked` and read it back. Raises InstrumentError where a setting is not accepted."""
    for mnemonic, value in asked.items():
        if mnemonic == "STAR":  # first once without verification, so that neither end can move the other afterwards
            start, stop = settings.text_of(value), settings.text_of(asked["STOP"])
            link.ask(f"STAR {start};STOP {stop};STAR?")
        settings.put(link, mnemonic, value)


def check_untouched(link: Connection, before: Mapping[str, settings.Value]) -> None:
    """Raise InstrumentError where a setting differs from `before` the sweep, or where it is not in HOLD."""
    after = settings.snapshot(link, before)
    settings.compare(link, before, after, "changed while the sweep ran; was a key pressed at the front panel?")
    if replies.flag(link.ask("CONT?"), f"{link.name}: CONT?"):
        raise InstrumentError(f"{link.name}: it sweeps again before its data were read; was a key pressed?")


def read(link: Connection, expected: Frequencies) -> tuple[Frequencies, Impedances]:
    """Return axis and data array of the sweep that is in HOLD: the complex R,X after every correction.

    Raises InstrumentError where the axis is not `expected` (Hz, shape (N,)).

    `OUTPDATA?` does not depend on the displayed parameter or trace (Programming Manual p.81). FORM3 is used, because a
    32-bit frequency has steps of 8 Hz at 110 MHz.
    """
    n = expected.size
    blocks = {
        query: replies.doubles(
            link.ask_block(f"FORM3;{query}", 8 * count, settings.LENGTH_DIGITS), count, f"{link.name}: {query}"
        )
        for query, count in (("OUTPSWPRM?", n), ("OUTPDATA?", 2 * n))
    }
    frequency, pairs = blocks["OUTPSWPRM?"], blocks["OUTPDATA?"]
    impedance = pairs[0::2] + 1j * pairs[1::2]
    if frequency[0] > frequency[-1]:
        frequency, impedance = frequency[::-1], impedance[::-1]
    _check_axis(link, frequency, expected)
    if not np.any(impedance):
        raise InstrumentError(f"{link.name}: OUTPDATA?: all {n} points are 0 ohm; nothing was measured")
    return frequency, impedance


def _check_axis(link: Connection, frequency: Frequencies, expected: Frequencies) -> None:
    """Raise InstrumentError where the axis is not the plan's grid, to the instrument's step of 1 mHz."""
    off = np.abs(frequency - expected)
    k = int(np.argmax(off))
    if off[k] > 1.1e-3:
        raise InstrumentError(
            f"{link.name}: OUTPSWPRM?: point {k + 1} is at {frequency[k]:.12g} Hz; the plan has it at "
            f"{expected[k]:.12g} Hz"
        )
