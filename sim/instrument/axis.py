"""The sweep axis: the values that the instrument sweeps, and the frequency and level at each of them.

Frequencies lie on the instrument's grid of 1 mHz; the first and the last point are exactly START and STOP.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ..language.messages import CommandError
from .settings import Number, number

MILLIHERTZ = 1e-3


RANGES: Mapping[str, tuple[float, float, float, float, str, float]] = {
    "OLEV": (5e-3, 1.0, 5e-3, 1.0, "V", 1e-3),
    "OLEV:A": (200e-6, 20e-3, 200e-6, 20e-3, "A", 1e-6),
    "DCB": (-40.0, 40.0, 0.0, 0.0, "V", 1e-3),
    "DCB:A": (-0.1, 0.1, 0.0, 0.0, "A", 10e-6),
}
"""Lowest and highest value, initial start and stop, unit and resolution of level and bias sweeps."""


@dataclass(frozen=True)
class ListSegment:
    """One line of the list-sweep table."""

    start: float
    stop: float
    points: int
    bandwidth: int
    level: float
    """V, or A where the `mode` is CURR."""
    bias: float
    """V."""
    point_average: int
    mode: str = "VOLT"
    """POWMOD of the segment."""
    bias_mode: str = "VOLT"
    bias_current: float = 0.0
    """A."""


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
    """Return range and default of START or STOP for a sweep parameter and type (PM p.444, 446).

    `parameter`: SWPP, with `:A` where level or bias are swept in ampere.
    """
    if parameter in RANGES:
        low, high, start, stop, unit, step = RANGES[parameter]
        return Number(low, high, start if edge == "STAR" else stop, unit, step)
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
        values if parameter.startswith("OLEV") else level * same,
        bandwidth * same,
        point_average * same,
    )


def list_axis(table: tuple[ListSegment, ...], parameter: str, fixed_frequency: float) -> Axis:
    """Return the axis of a list sweep. Raises CommandError where the table is empty."""
    if not table:
        raise CommandError(124)

    def column(values: list[float]) -> Reals:
        return np.repeat(np.asarray(values, dtype=np.float64), [s.points for s in table])

    values = np.concatenate([grid(s.start, s.stop, s.points, "LIN") for s in table])
    return Axis(
        values,
        values if parameter == "FREQ" else np.full(values.size, fixed_frequency),
        values if parameter.startswith("OLEV") else column([s.level for s in table]),
        column([float(s.bandwidth) for s in table]),
        column([float(s.point_average) for s in table]),
    )


def moved_edges(edge: str, argument: bytes, start: float, stop: float, kind: Number) -> tuple[float, float]:
    """Return START and STOP after STAR, STOP, CENT or SPAN was set; the range is kept within the limits.

    A START set above STOP moves STOP too, and vice versa [our reading: the programming manual does not say].
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
