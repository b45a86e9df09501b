"""The sweep axis: the values that the instrument sweeps, and the frequency and level at each of them.

Frequencies lie on the instrument's grid of 1 mHz; the first and the last point are exactly START and STOP.
"""

from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ..language.messages import CommandError
from .settings import Number, number

MILLIHERTZ = 1e-3


@dataclass(frozen=True)
class ListSegment:
    """One line of the list-sweep table."""

    start: float
    stop: float
    points: int
    bandwidth: int
    level: float
    bias: float
    point_average: int


@dataclass(frozen=True, eq=False)
class Axis:
    """The points of a sweep in the order of the axis. Every array has the shape (N,)."""

    values: Reals
    """The answer to OUTPSWPRM?: Hz, V or A."""
    frequency: Reals
    """Hz."""
    level: Reals
    """Oscillator level, V (or A in current mode)."""
    bandwidth: Reals
    """BWFACT of each point."""
    point_average: Reals
    """Measurements averaged at each point."""


def limits(edge: str, parameter: str, kind: str) -> Number:
    """Return range and default of START or STOP for a sweep parameter and type (reference 2.3, 2.4)."""
    if parameter == "OLEV":
        return Number(5e-3, 1.0, 5e-3 if edge == "STAR" else 1.0, "V", 1e-3)
    if parameter == "DCB":
        return Number(-40.0, 40.0, 0.0, "V", 1e-3)
    low, high = (60.0, 110e6) if edge == "STOP" else (40.0, 109.9998e6)
    if kind != "LOG":
        low, high = 40.0, 110e6
    return Number(low, high, 40.0 if edge == "STAR" else 110e6, "HZ", MILLIHERTZ)


def grid(start: float, stop: float, points: int, kind: str, step: float = MILLIHERTZ) -> Reals:
    """Return the values of a LIN or LOG sweep, shape (points,), rounded to `step`."""
    share = np.arange(points) / (points - 1)
    exact = start * (stop / start) ** share if kind == "LOG" else start + (stop - start) * share
    per_unit = round(1 / step)  # dividing by 1000 gives the nearest double, multiplying by 0.001 does not
    values = np.round(exact * per_unit) / per_unit
    values[0], values[-1] = start, stop
    return values


def plain_axis(
    *, parameter: str, kind: str, start: float, stop: float, points: int, fixed_frequency: float, level: float,
    bandwidth: int, point_average: int,
) -> Axis:  # fmt: skip
    """Return the axis of a LIN or LOG sweep of frequency, level or bias."""
    frequency_swept = parameter == "FREQ"
    values = grid(start, stop, points, kind, MILLIHERTZ if frequency_swept else 1e-6)
    same = np.ones(points)
    return Axis(
        values,
        values if frequency_swept else fixed_frequency * same,
        values if parameter == "OLEV" else level * same,
        bandwidth * same,
        point_average * same,
    )


def list_axis(table: tuple[ListSegment, ...]) -> Axis:
    """Return the axis of a list sweep of frequency. Raises CommandError where the table is empty."""
    if not table:
        raise CommandError(-221, "SETTINGS CONFLICT; LIST TABLE IS EMPTY")

    def column(values: list[float]) -> Reals:
        return np.repeat(np.asarray(values, dtype=np.float64), [s.points for s in table])

    values = np.concatenate([grid(s.start, s.stop, s.points, "LIN") for s in table])
    return Axis(
        values,
        values,
        column([s.level for s in table]),
        column([float(s.bandwidth) for s in table]),
        column([float(s.point_average) for s in table]),
    )


def moved_edges(edge: str, argument: bytes, start: float, stop: float, kind: Number) -> tuple[float, float]:
    """Return START and STOP after STAR, STOP, CENT or SPAN was set; the range is kept within the limits.

    START above STOP takes the other edge along [our reading: the manual's rule was not reachable].
    """
    if edge in ("STAR", "STOP"):
        value = kind.parse(argument)
        return (value, max(value, stop)) if edge == "STAR" else (min(start, value), value)
    value = number(argument, kind.unit)
    center, span = (start + stop) / 2, stop - start
    if edge == "CENT":
        center = min(max(value, kind.low), kind.high)
    else:
        span = min(max(value, 0.0), kind.high - kind.low)
    half = min(span / 2, center - kind.low, kind.high - center)
    if edge == "SPAN":
        half = span / 2
        center = min(max(center, kind.low + half), kind.high - half)
    return kind.rounded(center - half), kind.rounded(center + half)
