"""Segments swept in one go by the instrument's list sweep, where it proves that it took every line of the table.

No public source gives the mnemonics of a 4294A's table. Those of its sister 4395A, which speaks the same dialect, are
public (the Stanford Timing Interface's driver: EDITLIST, CLEL, SADD, STAR, STOP, POIN, SDON, EDITDONE, SWPT LIST;
the 4395A manual: when a table is edited, STAR and its like set a segment), and the 4294A's manual says of BWFACT that
it sets each segment's bandwidth. So nothing is believed. What a segment is set to is read back while it is edited. The
sweep's own settings are set to other values before: where they have changed afterwards, or where they were what was
read, the table was not what was written to. The axis of the finished sweep must be the plan's, to 1 mHz. Wherever this
fails `ListRefused` says why, and the segments are swept one by one.
"""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ....models.sweep_plan import Segment, SweepPlan
from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection, ConnectionLost
from .. import capabilities
from ..protocol import error_queue as errorqueue
from ..protocol import settings
from ..protocol import sweep_wait as wait
from . import grid
from . import single_sweep as sweeping

LINE_POINTS = 201
"""A line of the table has at most."""
_OF_A_LINE = ("STAR", "STOP", "POIN", "BWFACT", "POWE")
"""Settings of a line; in a list sweep the sweep's own have no meaning."""


class ListRefused(InstrumentError):
    """The instrument did not take a list sweep as it was meant; the segments can be swept one by one."""

    def __init__(self, says: str, swept: bool = False) -> None:
        super().__init__(says)
        self.swept = swept
        """Whether that came out only after the sweep: not to be tried again, as it costs as much each time."""


def why_not(plan: SweepPlan) -> str:
    """Return why `plan` is no list sweep, as a clause; "" where it is one."""
    if not plan.joined or len(plan.segments) < 2:
        return "its segments are not one recording"
    if any(segment.spacing == "log" for segment in plan.segments):
        return "a line of the table has linear steps alone"
    if any(segment.points > capabilities.MOST_POINTS for segment in plan.segments):
        return f"a segment has more than {capabilities.MOST_POINTS} points"
    if plan.bias_V or plan.point_average > 1:
        return "how a line of the table sets bias and point averaging is not known"
    return ""


def batches(plan: SweepPlan) -> tuple[tuple[Segment, ...], ...]:
    """Return the segments of `plan` by list sweeps: each of at most 801 points and 18 lines."""
    made: list[list[Segment]] = [[]]
    for segment in plan.segments:
        both = [*made[-1], segment]
        if len(lines(both)) > capabilities.MOST_LINES or sum(one.points for one in both) > capabilities.MOST_POINTS:
            made.append([segment])
        else:
            made[-1] = both
    return tuple(map(tuple, made))


def lines(segments: Sequence[Segment]) -> tuple[Segment, ...]:
    """Return the lines of the table for `segments`: each segment in stretches of at most 201 points, no point twice."""
    made: list[Segment] = []
    for segment in segments:
        frequency = grid.points(segment)
        edges = np.linspace(0, segment.points, -(-segment.points // LINE_POINTS) + 1).round().astype(int).tolist()
        made += [Segment(float(frequency[a]), float(frequency[b - 1]), b - a) for a, b in pairwise(edges)]
    return tuple(made)


def sweep(
    link: Connection, segments: Sequence[Segment], plan: SweepPlan, tick: Callable[[float], None]
) -> tuple[sweeping.RawSweep, ...]:
    """Sweep one of `batches(plan)`; return what each of its segments gave. `tick`: see `wait.finish`.

    Raises ListRefused, InstrumentError, and what `tick` raises.
    """
    table = lines(segments)
    axis = np.concatenate([grid.points(line) for line in table])
    try:
        got = _set_up(link, table, plan)
    except ConnectionLost:
        raise
    except InstrumentError as error:
        raise ListRefused(str(error)) from None
    tick(0.0)
    run = sweeping.run(link, plan, expected(segments, plan), tick)
    try:
        frequency, impedance = sweeping.read(link, axis)
    except ConnectionLost:
        raise
    except InstrumentError as error:
        raise ListRefused(str(error), swept=True) from None
    sweeping.check_untouched(link, {name: value for name, value in got.items() if name not in _OF_A_LINE})
    return tuple(
        sweeping.RawSweep(
            frequency[a:b],
            impedance[a:b],
            run.started,
            run.ended,
            run.seconds * (b - a) / axis.size,
            got | {"STAR": segment.start_Hz, "STOP": segment.stop_Hz, "POIN": float(b - a)},
        )
        for segment, (a, b) in zip(segments, pairwise(_edges(segments)), strict=True)
    )


def _edges(segments: Sequence[Segment]) -> list[int]:
    return [0, *np.cumsum([segment.points for segment in segments]).tolist()]


def _level(plan: SweepPlan) -> float:
    return plan.oscillator_V if plan.oscillator_A is None else plan.oscillator_A


def _others(plan: SweepPlan) -> dict[str, settings.Value]:
    """Return settings of the sweep itself that none of its lines has: what shows which of both is read and written."""
    least = capabilities.LOWEST_OSCILLATOR_V if plan.oscillator_A is None else capabilities.LOWEST_OSCILLATOR_A
    level = _level(plan)
    return {
        "POIN": capabilities.MOST_POINTS,
        "BWFACT": plan.bandwidth - 1 if plan.bandwidth > 1 else 2,
        "POWE": level / 2 if level / 2 >= least else 2 * level,
    }


def _set_up(link: Connection, table: Sequence[Segment], plan: SweepPlan) -> dict[str, settings.Value]:
    """Fill the table and switch to it; return all settings as read back, those of a line from the last one.

    Raises InstrumentError where anything differs from what was asked.
    """
    wanted = sweeping.wanted(replace(table[0], stop_Hz=table[-1].stop_Hz), plan) | _others(plan)
    sweeping.set_up(link, wanted)
    own: dict[str, settings.Value] = {}
    try:
        _command(link, "EDITLIST;CLEL")
        for line in table:
            _command(link, "SADD")
            values = (line.start_Hz, line.stop_Hz, line.points, plan.bandwidth, _level(plan))
            own = {name: settings.put(link, name, value) for name, value in zip(_OF_A_LINE, values, strict=True)}
            _command(link, "SDON")
        _command(link, "EDITDONE")
    except BaseException:
        link.doubt()
        with contextlib.suppress(InstrumentError):  # so that what comes next is not written to a line of the table
            link.ask("SDON;EDITDONE;*CLS;*ESR?")
        raise
    errorqueue.check(link, "after the list-sweep table")
    before = settings.snapshot(link, settings.SETTINGS | settings.CONDITIONS)
    settings.compare(link, wanted, before, "the list-sweep table was not what was written to")
    settings.put(link, "SWPT", "LIST")
    errorqueue.check(link, "after SWPT LIST")
    return before | own | {"SWPT": "LIST"}


def _command(link: Connection, command: str) -> None:
    """Send what has no query. Raises InstrumentError where the instrument does not know it, or cannot do it now."""
    events = replies.integer(link.ask(f"*CLS;{command};*ESR?"), f"{link.name}: *ESR?")
    if events & wait.ERRORS:
        errorqueue.check(link, f"after {command}")
        raise InstrumentError(f"{link.name}: {command} was refused (event status register {events})")


def expected(segments: Sequence[Segment], plan: SweepPlan) -> float:
    """Return the seconds that one of `batches(plan)` takes."""
    return sum(sweeping.expected_seconds(segment, plan) for segment in segments)
