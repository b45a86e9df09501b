"""Several segments in one list sweep of the instrument, if it is verified to have accepted every line of the table.

Programming Manual p.44-45 and 415-436: EDITLIST, CLEL, SADD ... SDON for each line, EDITDONE, SWPT LIST. A command
that does not belong to the table discards an open line, so each line is one message. The finished table is verified:
each line is opened again and read back, and the axis of the finished sweep must be the plan's, to 1 mHz. Beforehand the
sweep's own settings are set to other values: if they have changed afterwards, the commands did not reach the table.
If any of this fails, `ListRefused` says why, and the segments are swept one by one.
"""

import contextlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from ....models.sweep_plan import Segment, SweepPlan
from ...base.analyzer import InstrumentError
from ...visa import replies
from ...visa.connection import Connection, ConnectionLost
from .. import capabilities
from ..protocol import bias, settings
from ..protocol import error_queue as errorqueue
from ..protocol import sweep_wait as wait
from . import grid
from . import single_sweep as sweeping

LINE_POINTS = 201
"""A line of the table has at most."""
_OF_A_LINE = ("STAR", "STOP", "POIN", "POWMOD", "POWE", "DCMOD", "DCV", "BWFACT", "PAVERFACT")
"""Settings of a line, in the order of setting; in a list sweep they replace the sweep's own."""


class ListRefused(InstrumentError):
    """The instrument did not accept a list sweep as intended; the segments can be swept one by one."""

    def __init__(self, says: str, swept: bool = False) -> None:
        super().__init__(says)
        self.swept = swept
        """Whether this was detected only after the sweep: then do not try again, as each attempt costs a sweep."""


def why_not(plan: SweepPlan) -> str:
    """Return why `plan` cannot be a list sweep, as a clause; "" where it can."""
    if not plan.joined or len(plan.segments) < 2:
        return "its segments are not one recording"
    if any(segment.spacing == "log" for segment in plan.segments):
        return "a line of the table has linear steps alone"
    if any(segment.points > capabilities.MOST_POINTS for segment in plan.segments):
        return f"a segment has more than {capabilities.MOST_POINTS} points"
    return ""


def batches(plan: SweepPlan) -> tuple[tuple[Segment, ...], ...]:
    """Return the segments of `plan` grouped into list sweeps of at most 801 points and 18 lines."""
    made: list[list[Segment]] = [[]]
    for segment in plan.segments:
        both = [*made[-1], segment]
        if len(lines(both)) > capabilities.MOST_LINES or sum(one.points for one in both) > capabilities.MOST_POINTS:
            made.append([segment])
        else:
            made[-1] = both
    return tuple(map(tuple, made))


def lines(segments: Sequence[Segment]) -> tuple[Segment, ...]:
    """Return the lines of the table for `segments`: each segment in parts of at most 201 points, no point twice."""
    made: list[Segment] = []
    for segment in segments:
        frequency = grid.points(segment)
        edges = np.linspace(0, segment.points, -(-segment.points // LINE_POINTS) + 1).round().astype(int).tolist()
        made += [Segment(float(frequency[a]), float(frequency[b - 1]), b - a) for a, b in pairwise(edges)]
    return tuple(made)


def sweep(
    link: Connection, segments: Sequence[Segment], plan: SweepPlan, tick: Callable[[float], None]
) -> tuple[sweeping.RawSweep, ...]:
    """Sweep one of `batches(plan)`; return the data of each of its segments. `tick`: see `sweep_wait.finish`.

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
    """Return settings for the sweep itself that differ from every line's, to tell which of both is read and written."""
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
    lines_wanted = [_line(segment, plan) for segment in table]
    try:
        _command(link, "EDITLIST;CLEL")
        for line in lines_wanted:
            _command(link, ";".join(["SADD", *(f"{m} {settings.text_of(v)}" for m, v in line.items()), "SDON"]))
        _command(link, "EDITDONE")
        own = [_read_line(link, k, line) for k, line in enumerate(lines_wanted, start=1)]
        _command(link, "EDITDONE")
    except BaseException:
        link.doubt()
        with contextlib.suppress(InstrumentError):  # so that the next commands are not written to a line of the table
            link.ask("SDON;EDITDONE;*CLS;*ESR?")
        raise
    errorqueue.check(link, "after the list-sweep table")
    before = settings.snapshot(link, settings.SETTINGS | settings.CONDITIONS)
    settings.compare(link, wanted, before, "the list-sweep table was not what was written to")
    if plan.bias_V:
        bias.switch_on(link, plan.bias_V)
        before |= settings.snapshot(link, ("DCRNG", "DCO"))
    settings.put(link, "SWPT", "LIST")
    errorqueue.check(link, "after SWPT LIST")
    return before | own[-1] | {"SWPT": "LIST"}


def _line(segment: Segment, plan: SweepPlan) -> dict[str, settings.Value]:
    """Return the settings of a line of the table, in the order of setting."""
    values = (
        *(segment.start_Hz, segment.stop_Hz, segment.points),
        *("VOLT" if plan.oscillator_A is None else "CURR", _level(plan)),
        *("CVOLT" if plan.bias_V else "VOLT", plan.bias_V),
        *(plan.bandwidth, plan.point_average),
    )
    return dict(zip(_OF_A_LINE, values, strict=True))


def _read_line(link: Connection, number: int, wanted: Mapping[str, settings.Value]) -> dict[str, settings.Value]:
    """Open a line of the table again, return what it holds, and close it. Raises InstrumentError where it differs."""
    _command(link, f"SEDI {number}")
    got = settings.snapshot(link, wanted)
    link.ask("SDON;*ESR?")
    settings.compare(link, wanted, got, f"the instrument did not take line {number} of the list-sweep table")
    return got


def _command(link: Connection, command: str) -> None:
    """Send a command that has no query. Raises InstrumentError where it is unknown or not possible now."""
    events = replies.integer(link.ask(f"*CLS;{command};*ESR?"), f"{link.name}: *ESR?")
    if events & wait.ERRORS:
        errorqueue.check(link, f"after {command}")
        raise InstrumentError(f"{link.name}: {command} was refused (event status register {events})")


def expected(segments: Sequence[Segment], plan: SweepPlan) -> float:
    """Return the seconds that one of `batches(plan)` takes."""
    return sum(sweeping.expected_seconds(segment, plan) for segment in segments)
