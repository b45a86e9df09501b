"""A comparison as a picture: both recordings, their difference, and its explanation."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ....fitters.compare.comparison import ComparedCurve
from .picture_file import as_label, save_picture

BEFORE, AFTER, EXPLAINED, LEFT, HELD = "#8a8f98", "#1f5fa8", "#e07b12", "#b4342a", "#4b7f52"
_STRIP = 0.025
"""Height of the strip that marks held-out data, relative to the axes."""


def comparison_picture(found: Mapping[str, Any], curve: ComparedCurve, path: Path) -> Path:
    """Draw a comparison (the object of `comparison_json`, and its curve); return the path. Raises PictureError."""
    return save_picture(comparison_figure(found, curve), path, dpi=160)


def comparison_figure(found: Mapping[str, Any], curve: ComparedCurve) -> Any:
    """Return the figure: |Z| and phase of both, and below them the difference without and with the findings."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(10.5, 8.0), layout="constrained")
    FigureCanvasAgg(figure)
    size, phase, change = figure.subplots(3, 1, sharex=True, height_ratios=[1.2, 1.0, 1.2])
    f = curve.frequency / 1e3
    lines = [("before", curve.before, BEFORE, "-"), ("after", curve.after, AFTER, "-")]
    if found["findings"]:
        lines.append(("before, with what was found", curve.explained, EXPLAINED, "--"))
    for label, Z, colour, style in lines:
        size.plot(f, np.abs(Z), color=colour, linestyle=style, linewidth=1.2, label=label)
        phase.plot(f, np.degrees(np.angle(Z)), color=colour, linestyle=style, linewidth=1.2)
    size.set_yscale("log")
    size.set_ylabel("|Z| (ohm)", fontsize=9)
    size.legend(fontsize=8.5, frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0)
    phase.set_ylabel("phase (deg)", fontsize=9)
    change.plot(f, np.abs(np.log(curve.after / curve.before)), color=AFTER, linewidth=1.2, label="what changed")
    if found["findings"]:
        left = np.abs(np.log(curve.after / curve.explained))
        change.plot(f, left, color=LEFT, linewidth=1.0, label="what the findings leave")
    for low, high in found["held_out_Hz"]:
        change.axvspan(low / 1e3, high / 1e3, ymax=_STRIP, color=HELD, linewidth=0)
    change.fill_between([], [], color=HELD, linewidth=0, label="held out for the proof")
    change.set_yscale("log")
    change.set_ylabel("|ln Z ratio|", fontsize=9)
    change.set_xlabel("frequency (kHz)", fontsize=9)
    change.legend(fontsize=8.5, frameon=False, ncols=3, loc="lower right", bbox_to_anchor=(1.0, 1.0), borderaxespad=0)
    for axes in (size, phase, change):
        axes.tick_params(labelsize=8.5)
        axes.spines[["top", "right"]].set_visible(False)
    figure.suptitle(as_label("\n".join(found["says"][:3])), fontweight="bold", fontsize=11, ha="left", x=0.02)
    return figure
