"""One sweep of an E4990A: set up, trigger, wait, read."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Frequencies, Impedances, Reals
from ...models.sweep import now_utc
from ...models.sweep_plan import Segment, SweepPlan
from ..base.analyzer import InstrumentError
from ..visa import replies
from ..visa.connection import Connection
from .settings import BIAS_ON, BLOCK_DIGITS, SETTINGS, Value, check_errors, put

OPERATION_COMPLETE = 1
"""Bit 0 of the standard event register: `*OPC` after the trigger sets it when the sweep is over (IEEE 488.2)."""
POLL_SECONDS = 0.05
PATIENCE, MARGIN_SECONDS = 2.0, 15.0


@dataclass(frozen=True, eq=False)
class SweepReadout:
    """The data of one sweep."""

    frequency: Frequencies
    """Hz, shape (N,), rising."""
    impedance: Impedances
    """ohm, shape (N,)."""
    started: str
    ended: str
    seconds: float


def points(segment: Segment) -> Frequencies:
    """Return the frequencies of a segment, shape (points,)."""
    if segment.spacing == "log":
        return np.geomspace(segment.start_Hz, segment.stop_Hz, segment.points)
    return np.linspace(segment.start_Hz, segment.stop_Hz, segment.points)


def common(plan: SweepPlan) -> dict[str, Value]:
    """Return the settings of `plan` that all its sweeps share, by their names in SETTINGS."""
    return {
        "continuous": True,
        "source": "BUS",
        "direction": "DOWN" if plan.direction == "down" else "UP",
        "speed": plan.bandwidth,
        "point_average": plan.point_average,
        "point_averaging": plan.point_average > 1,
        "sweep_average": plan.sweep_average,
        "sweep_averaging": plan.sweep_average > 1,
        "trigger_averages": plan.sweep_average > 1,
        "mode": "VOLT",
        "level": plan.oscillator_V,
        "bias_mode": "VOLT",
        "bias": plan.bias_V,
    }


def set_up(link: Connection, segments: Sequence[Segment], plan: SweepPlan) -> dict[str, Value]:
    """Set everything up for one sweep over `segments`; return what was read back. Raises InstrumentError."""
    put(link, BIAS_ON, False)
    got = {name: put(link, SETTINGS[name], value) for name, value in common(plan).items()}
    if len(segments) == 1:
        got |= _plain(link, segments[0])
    else:
        _segmented(link, segments)
        got["type"] = put(link, SETTINGS["type"], "SEGM")
    if plan.bias_V:
        put(link, BIAS_ON, True)
    check_errors(link, "after the set-up")
    return got


def _plain(link: Connection, segment: Segment) -> dict[str, Value]:
    """Set an ordinary sweep; both ends are first sent without verification, so that neither moves the other later."""
    start, stop = segment.start_Hz, segment.stop_Hz
    link.ask(f":SENS1:FREQ:STAR {start:.12g};:SENS1:FREQ:STOP {stop:.12g};:SENS1:FREQ:STAR?")
    wanted: dict[str, Value] = {
        "type": "LOG" if segment.spacing == "log" else "LIN",
        "start": start,
        "stop": stop,
        "points": segment.points,
    }
    return {name: put(link, SETTINGS[name], value) for name, value in wanted.items()}


def _segmented(link: Connection, segments: Sequence[Segment]) -> None:
    """Write the segment table: `7`, start and stop, no individual settings, then each segment [1]."""
    rows = ",".join(f"{s.start_Hz:.12g},{s.stop_Hz:.12g},{s.points}" for s in segments)
    answer = link.ask(f":SENS1:SEGM:DATA 7,0,0,0,0,0,0,0,{len(segments)},{rows};:SENS1:SEGM:SWE:POIN?")
    count, wanted = replies.integer(answer, f"{link.name}: :SENS1:SEGM:SWE:POIN?"), sum(s.points for s in segments)
    if count != wanted:
        raise InstrumentError(f"{link.name}: the segment table has {count} points; {wanted} were written")


def sweep(
    link: Connection, segments: Sequence[Segment], expected_seconds: float, tick: Callable[[float], None]
) -> SweepReadout:
    """Trigger a sweep, wait for it, and read it. Raises InstrumentError, and whatever `tick` raises to cancel."""
    started, begun = now_utc(), time.monotonic()
    trigger(link, ":CALC1:AVER:CLE;:TRIG:SING", expected_seconds, tick, "the sweep")
    ended, seconds = now_utc(), time.monotonic() - begun
    frequency, impedance = read(link, np.concatenate([points(s) for s in segments]))
    return SweepReadout(frequency, impedance, started, ended, seconds)


def trigger(
    link: Connection,
    command: str,
    expected_seconds: float,
    tick: Callable[[float], None],
    what: str,
    may_block: bool = False,
) -> None:
    """Send a long command and return when it is done. Raises InstrumentError, and whatever `tick` raises.

    The instrument answers queries while it sweeps [2]; `may_block` allows for one that does not.
    """
    begun, limit = time.monotonic(), PATIENCE * expected_seconds + MARGIN_SECONDS
    message = f"*CLS;{command};*OPC;*ESR?"
    while True:
        passed = time.monotonic() - begun
        if may_block:
            answer = link.ask_patiently(message, limit - passed, lambda more, before=passed: tick(before + more))
        else:
            answer = link.ask(message)
        if replies.integer(answer, f"{link.name}: *ESR?") & OPERATION_COMPLETE:
            break
        if passed > limit:
            late = f"did not end within {limit:.0f} s; {expected_seconds:.0f} s were expected"
            raise InstrumentError(f"{link.name}: {what} {late}")
        tick(passed)
        link.rest(min(POLL_SECONDS, 0.002 + passed / 10))
        message = "*ESR?"
    check_errors(link, f"after {what}")


def read(link: Connection, expected: Frequencies) -> tuple[Frequencies, Impedances]:
    """Return axis and impedance of the finished sweep. Raises InstrumentError where the axis is not `expected`.

    Trace 1 shows R and then X: the formatted data of a trace include every correction [3] [4].
    """
    n = expected.size
    frequency = _numbers(link, ":FORM:DATA REAL;:FORM:BORD NORM;:SENS1:FREQ:DATA?", n)
    parts = [_numbers(link, f":CALC1:PAR1:DEF {name};:CALC1:PAR1:SEL;:CALC1:DATA:FDAT?", 2 * n)[0::2] for name in "RX"]
    link.ask(":FORM:DATA ASC;*ESR?")
    impedance = parts[0] + 1j * parts[1]
    if frequency[0] > frequency[-1]:
        frequency, impedance = frequency[::-1], impedance[::-1]
    off = np.abs(frequency - expected) / expected
    worst = int(np.argmax(off))
    if off[worst] > 1e-6 and abs(frequency[worst] - expected[worst]) > 2e-3:
        raise InstrumentError(
            f"{link.name}: :SENS1:FREQ:DATA?: point {worst + 1} is at {frequency[worst]:.12g} Hz; the plan has it at "
            f"{expected[worst]:.12g} Hz"
        )
    if not np.any(impedance):
        raise InstrumentError(f"{link.name}: :CALC1:DATA:FDAT?: all {n} points are 0 ohm; nothing was measured")
    return frequency, impedance


def _numbers(link: Connection, message: str, count: int) -> Reals:
    return replies.doubles(link.ask_block(message, 8 * count, BLOCK_DIGITS), count, f"{link.name}: {message}")
