"""A diagnosis as a picture: residuals before and after, the build with the guilty places, what else it could be."""

from pathlib import Path
from typing import Any

import numpy as np

from ..fitters.diagnosis.findings import Diagnosis
from ..models.build import Build

_BEFORE, _AFTER, _GUILTY = "tab:red", "tab:blue", "#ffd9b0"


def diagnosis_picture(diagnosis: Diagnosis, build: Build, path: Path) -> Path:
    """Draw the diagnosis; return the path of the PNG or SVG."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    rows = len(diagnosis.before)
    figure: Any = Figure(figsize=(12, 2.6 * rows + 3.4), layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.add_gridspec(rows + 1, 2, height_ratios=[*[1.0] * rows, 1.1])
    for k in range(rows):
        _residuals(figure.add_subplot(grid[k, :]), diagnosis, k)
    _layers(figure.add_subplot(grid[rows, 0]), diagnosis, build)
    _candidates(figure.add_subplot(grid[rows, 1]), diagnosis)
    figure.suptitle(f"{build.name}: {diagnosis.says[0]}")
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path, dpi=110)
    return path


def _residuals(axes: Any, diagnosis: Diagnosis, k: int) -> None:
    before, after = diagnosis.before[k], diagnosis.after[k]
    f = before.frequency / 1e6
    for curve, colour, label in ((before, _BEFORE, "without effects"), (after, _AFTER, "with them")):
        size = np.abs(np.log(curve.fitted / curve.measured))
        axes.semilogy(f, np.maximum(size, 1e-7), color=colour, linewidth=0.8, label=label)
    for finding in diagnosis.findings:
        if finding.step == before.step:
            for low, high in finding.bands_Hz:
                axes.axvspan(low / 1e6, high / 1e6, color=_GUILTY, zorder=0)
    axes.set_ylabel(f"{before.step}: |ln Z_model/Z|")
    axes.set_xlabel("frequency (MHz)")
    axes.legend(fontsize="small", loc="upper right")


def _layers(axes: Any, diagnosis: Diagnosis, build: Build) -> None:
    """Draw the layers back to front, thin ones widened, with the guilty places in colour."""
    guilty = {finding.where for finding in diagnosis.findings}
    widths = np.array([layer.values["thickness"].re for layer in build.layers]) ** 0.4
    edges = np.concatenate([[0.0], np.cumsum(widths / widths.sum())])
    for layer, left, right in zip(build.layers, edges, edges[1:], strict=False):
        colour = _GUILTY if f"layer:{layer.name}" in guilty else "0.92"
        axes.add_patch(_rectangle(left, right, colour))
        axes.text((left + right) / 2, 0.5, layer.name, ha="center", va="center", rotation=90, fontsize="small")
    names = [layer.name for layer in build.layers]
    places = {"face:back": 0.0, "face:front": 1.0}
    for where in guilty:
        if where.startswith("interface:"):
            behind, _, before = where.removeprefix("interface:").partition("|")
            places[where] = float((edges[names.index(behind) + 1] + edges[names.index(before)]) / 2)
        if where in places:
            axes.plot([places[where]] * 2, [0.15, 0.85], color=_BEFORE, linewidth=4)
    for name in ("terminals", "sweep"):
        if name in guilty:
            axes.text(0.5, 0.93, f"the mismatch sits in the {name}", ha="center", color=_BEFORE)
    axes.set_xlim(-0.05, 1.05)
    axes.set_ylim(0, 1)
    axes.set_axis_off()
    axes.set_title("back to front, thin layers widened", fontsize="small")


def _rectangle(left: float, right: float, colour: str) -> Any:
    from matplotlib.patches import Rectangle

    return Rectangle((left, 0.2), right - left, 0.6, facecolor=colour, edgecolor="black", linewidth=0.8)


def _candidates(axes: Any, diagnosis: Diagnosis) -> None:
    bars = [
        (f"{one.effect} at {one.where}", one.probability)
        for finding in diagnosis.findings
        for one in (finding, *finding.alternatives)
    ]
    if not bars:
        axes.text(0.5, 0.5, "nothing left out that this recording could show", ha="center", va="center")
        axes.set_axis_off()
        return
    labels, sizes = zip(*bars[::-1], strict=True)
    axes.barh(range(len(bars)), sizes, color=_AFTER)
    axes.set_yticks(range(len(bars)), labels, fontsize="small")
    axes.set_xlim(0, 1)
    axes.set_xlabel("probability")
