"""Control charts of one constant over samples in the order of their measurement, and the capability of the process.

Individuals chart (ISO 7870-2): sigma is estimated from the scatter between neighbouring samples, mean moving range /
1.128, so that a slow drift does not widen the limits. The EWMA chart (ISO 7870-6), with weight 0.2 and limits at 2.962
sigma, detects small lasting shifts; its mean time to a false alarm is 500 samples. Capability by ISO 22514-2.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...models.base.arrays import Reals
from ...models.base.errors import CannotError
from ...models.specification import Limit

FEWEST = 3
"""Fewest samples of a chart."""
_D2 = 1.128  # mean range of two samples / sigma
_WEIGHT, _WIDTH = 0.2, 2.962
_SAME_SIDE, _TREND = 9, 6
_UNSURE = 20
"""Samples below which the control limits themselves are uncertain by more than a sixth."""


class ChartError(CannotError):
    """The samples give no control chart."""


@dataclass(frozen=True)
class ChartValue:
    """One sample's value; SI units."""

    sample: str
    time: str
    value: float
    u: float | None


@dataclass(frozen=True)
class ChartPoint:
    """One sample on the charts."""

    sample: str
    time: str
    value: float
    u: float | None
    ewma: float
    ewma_low: float
    ewma_high: float
    signals: tuple[str, ...]
    """The rules that this sample violates; empty while the process is in control."""


@dataclass(frozen=True)
class Capability:
    """How well the process keeps its limits; the scatter of the measurement itself is included."""

    n: int
    cp: float | None
    """None for a limit with one end."""
    cpk: float
    cpk_low: float
    """Lower end of the 95 % interval of Cpk (Bissell 1990)."""
    pp: float | None
    ppk: float
    """Like Cpk, but from the scatter of all samples instead of that between neighbours."""


@dataclass(frozen=True)
class ControlChart:
    """The Shewhart and EWMA charts of one constant; SI units."""

    centre: float
    sigma: float
    low: float
    high: float
    baseline: int
    """Number of first samples that set centre and limits."""
    points: tuple[ChartPoint, ...]
    capability: Capability | None
    """None without a limit."""
    says: tuple[str, ...]

    @property
    def left(self) -> tuple[ChartPoint, ...]:
        """The samples at which the process left control."""
        return tuple(point for point in self.points if point.signals)


def control_chart(
    values: Sequence[ChartValue], baseline: int | None = None, limit: Limit | None = None
) -> ControlChart:
    """Return the charts of `values` in their order; the first `baseline` of them (None: all) set the limits.

    Raises ChartError if there are too few values, or if they do not scatter.
    """
    used = len(values) if baseline is None else min(baseline, len(values))
    if used < FEWEST:
        raise ChartError(f"{used} sample(s) to set the control limits by; at least {FEWEST} are needed")
    x = np.array([value.value for value in values])
    centre, sigma = float(np.mean(x[:used])), float(np.mean(np.abs(np.diff(x[:used])))) / _D2
    if sigma == 0:
        raise ChartError("all samples have the same value: it was probably held, and without scatter there is no chart")
    low, high = centre - 3 * sigma, centre + 3 * sigma
    points: list[ChartPoint] = []
    ewma = centre
    for k, value in enumerate(values):
        ewma += _WEIGHT * (value.value - ewma)
        spread = _WIDTH * sigma * math.sqrt(_WEIGHT / (2 - _WEIGHT) * (1 - (1 - _WEIGHT) ** (2 * (k + 1))))
        signals = _signals(x[: k + 1], centre, low, high)
        if abs(ewma - centre) > spread:
            signals.append(f"lasting shift {'up' if ewma > centre else 'down'} (EWMA)")
        point = ChartPoint(
            value.sample,
            value.time,
            value.value,
            value.u,
            ewma,
            centre - spread,
            centre + spread,
            tuple(signals),
        )
        points.append(point)
    says = _remarks(values[:used], sigma)
    capable = _capability(x, sigma, limit) if limit is not None else None
    return ControlChart(centre, sigma, low, high, used, tuple(points), capable, says)


def _signals(x: Reals, centre: float, low: float, high: float) -> list[str]:
    """Return which rules of the individuals chart the last value breaks (ISO 7870-2: rules 1, 2 and 3)."""
    signals: list[str] = []
    if x[-1] > high or x[-1] < low:
        signals.append(f"{'above' if x[-1] > high else 'below'} the 3 sigma limit")
    side = np.sign(x[-_SAME_SIDE:] - centre)
    if x.size >= _SAME_SIDE and abs(side.sum()) == _SAME_SIDE:
        signals.append(f"{_SAME_SIDE} samples in a row {'above' if side[0] > 0 else 'below'} the centre")
    steps = np.sign(np.diff(x[-_TREND:]))
    if x.size >= _TREND and abs(steps.sum()) == _TREND - 1:
        signals.append(f"{_TREND} samples in a row {'rising' if steps[0] > 0 else 'falling'}")
    return signals


def _remarks(values: Sequence[ChartValue], sigma: float) -> tuple[str, ...]:
    says: list[str] = []
    if len(values) < _UNSURE:
        says.append(
            f"the control limits come from {len(values)} samples and are uncertain by "
            f"{100 * math.sqrt(0.41 / (len(values) - 1)):.0f} %; {_UNSURE} or more are usual"
        )
    stated = [value.u for value in values if value.u is not None]
    if len(stated) == len(values) and float(np.median(stated)) > 2 * sigma:
        says.append(
            "the samples scatter less than their uncertainties: a shared error, as of one micrometer, is not seen"
        )
    return tuple(says)


def _capability(x: Reals, sigma: float, limit: Limit) -> Capability:
    mean, n, overall = float(np.mean(x)), int(x.size), float(np.std(x, ddof=1))
    ends = [end for end in (limit.low, limit.high) if end is not None]
    room = min(abs(end - mean) * (1 if _is_inside(mean, limit) else -1) for end in ends)
    cpk, ppk = room / (3 * sigma), room / (3 * overall)
    both = limit.high - limit.low if limit.high is not None and limit.low is not None else None
    return Capability(
        n=n,
        cp=None if both is None else both / (6 * sigma),
        cpk=cpk,
        cpk_low=cpk - 1.96 * math.sqrt(1 / (9 * n) + cpk**2 / (2 * (n - 1))),
        pp=None if both is None else both / (6 * overall),
        ppk=ppk,
    )


def _is_inside(mean: float, limit: Limit) -> bool:
    return (limit.low is None or mean >= limit.low) and (limit.high is None or mean <= limit.high)
