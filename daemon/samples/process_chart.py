"""The control chart of a constant over the samples of the journal, in the order in which they were measured."""

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec

from ...fitters.plugins import DEFAULT
from ...fitters.population.control_chart import ChartValue, ControlChart, control_chart
from ...models.specification import Limit
from ..files.builds.limits_table import with_limits
from ..journal.journal_reader import JournalReader
from .sample_record import UnknownSampleError
from .sample_selection import NoSamplesError, latest_fits


@dataclass(frozen=True)
class ProcessChart:
    """The control chart of one constant, with its name, unit and limit."""

    constant: str
    fitter: str
    step: str | None
    unit: str
    limit: Limit | None
    chart: ControlChart

    @property
    def title(self) -> str:
        """The title of the chart."""
        return f"{self.constant} by {self.fitter}" + (f", step {self.step}" if self.step else "")

    def json(self) -> dict[str, Any]:
        """Return the chart as plain data."""
        plain: dict[str, Any] = msgspec.to_builtins(self)
        return plain | plain.pop("chart") | {"left": [point.sample for point in self.chart.left]}


def process_chart(
    journal: JournalReader,
    constant: str,
    *,
    fitter: str = DEFAULT,
    step: str | None = None,
    baseline: int | None = None,
    limits: Path | None = None,
    with_withdrawn: bool = False,
) -> ProcessChart:
    """Return the chart of `disk.c33D` (or `disk.c33D.im`) over the latest fit of each sample.

    The limit is that of the newest sample's build, or of the specification file `limits`. Raises NoSamplesError,
    UnknownSampleError, ChartError, BuildError.
    """
    fits = latest_fits(journal, fitter, step, with_withdrawn=with_withdrawn)
    if not fits:
        raise NoSamplesError(f"the journal in {journal.name} holds no fit by {fitter!r}; `pzctl fit --all` makes them")
    ordered = sorted(fits.items(), key=lambda one: one[1].measurement.time)
    bare = constant.removesuffix(".im")
    values: list[ChartValue] = []
    unit = ""
    for sample, fit in ordered:
        known = fit.result.constants.get(bare) or fit.result.derived.get(bare)
        if known is None or not fit.result.converged:
            continue
        value, u = (known.im, known.u_im) if bare != constant else (known.re, known.u_re)
        if math.isfinite(value) and u != 0 and (u is None or math.isfinite(u)):
            unit = known.unit
            values.append(ChartValue(sample, fit.measurement.time, value, u))
    if not values:
        there = dict.fromkeys(name for fit in fits.values() for name in (*fit.result.constants, *fit.result.derived))
        raise UnknownSampleError(f"constant {constant!r}: no sample's fit determined it; there are {', '.join(there)}")
    build = with_limits(ordered[-1][1].build, limits)
    limit = build.specification.limits.get(constant) if build.specification else None
    chart = control_chart(values, baseline, limit)
    return ProcessChart(constant, fitter, step, unit, limit, chart)
