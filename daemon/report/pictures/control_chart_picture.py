"""Control charts as a picture: values with their limits, and below them the EWMA."""

from typing import Any

import numpy as np

from ....fitters.population.control_chart import ControlChart
from ....models.specification import Limit
from .picture_file import as_label

_IN, _OUT, _LINE, _LIMIT = "#1f5fa8", "#c8321f", "0.35", "#a06000"


def control_chart_figure(chart: ControlChart, title: str, unit: str, limit: Limit | None) -> Any:
    """Return the figure; `title` names the constant and where it was measured."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    n = len(chart.points)
    figure: Any = Figure(figsize=(min(16.0, max(7.0, 0.35 * n + 2)), 7.0), layout="constrained")
    FigureCanvasAgg(figure)
    values, ewma = figure.subplots(2, 1, sharex=True, height_ratios=[2, 1.3])
    x = np.arange(n)
    colours = [_OUT if point.signals else _IN for point in chart.points]
    y = np.array([point.value for point in chart.points])
    values.errorbar(x, y, yerr=[point.u or 0.0 for point in chart.points], fmt="none", ecolor="0.6", capsize=2)
    values.plot(x, y, color="0.7", linewidth=0.8)
    values.scatter(x, y, c=colours, zorder=3)
    values.axhline(chart.centre, color=_LINE, linewidth=0.8)
    for end in (chart.low, chart.high):
        values.axhline(end, color=_LINE, linestyle="--")
    for end in (limit.low, limit.high) if limit is not None else ():
        if end is not None:
            values.axhline(end, color=_LIMIT, linestyle=":", label="specification")
    ewma.plot(x, [point.ewma for point in chart.points], color=_IN, marker="o", linewidth=0.8, markersize=4)
    for end in ("ewma_low", "ewma_high"):
        ewma.step(x, [getattr(point, end) for point in chart.points], where="mid", color=_LINE, linestyle="--")
    ewma.axhline(chart.centre, color=_LINE, linewidth=0.8)
    if chart.baseline < n:
        for axes in (values, ewma):
            axes.axvline(chart.baseline - 0.5, color="0.8")
    label = "" if unit == "1" else f" ({unit})"
    for axes, name in ((values, f"value{label}"), (ewma, "EWMA")):
        axes.set_ylabel(name)
    ewma.set_xticks(x, [as_label(point.sample) for point in chart.points], rotation=90, fontsize="small")
    values.set_title(as_label(title))
    return figure
