"""Constants against temperature as a picture."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....fitters.population.trend import Trend
from .picture_file import as_label

Series = tuple[str, str, Sequence[float], Sequence[float], Sequence[float], Trend]
"""Name, unit, x, y, standard uncertainties, and the trend."""


def trend_figure(series: Sequence[Series], against: str) -> Any:
    """Return the figure, with one plot per constant."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = min(3, len(series))
    rows = -(-len(series) // columns)
    figure: Any = Figure(figsize=(4.6 * columns, 3.4 * rows), layout="constrained")
    FigureCanvasAgg(figure)
    axes = figure.subplots(rows, columns, squeeze=False).ravel()
    for unused in axes[len(series) :]:
        unused.set_axis_off()
    for (name, unit, x, y, u, trend), place in zip(series, axes, strict=False):
        place.errorbar(x, y, yerr=u, fmt="o", color="#1f5fa8", ecolor="0.7", capsize=2, markersize=4)
        fine = np.linspace(min(x), max(x), 100)
        place.plot(fine, [trend.at(float(one)) for one in fine], color="#c8321f", linewidth=1)
        place.set_title(as_label(name + ("" if unit == "1" else f" ({unit})")), fontsize="medium")
        place.set_xlabel(as_label(against))
    return figure
