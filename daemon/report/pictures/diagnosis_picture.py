"""A diagnosis as a picture: residuals before and after, the device with the findings marked, and the alternatives."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np

from ....fitters.engine.noise import noise_from_smoothness
from ....fitters.interface import Curve
from ....models.base.arrays import Reals
from ....models.build import Build
from ....models.sweep import Sweep
from ..probability import probability_text
from .correction_panels import MOST_PANELS, draw_corrections
from .device_sketch import draw_sketch
from .picture_file import as_label, save_picture

BEFORE, AFTER, EXPLAINED = "#b4342a", "#1f5fa8", "#6a4c93"
SHOWS, MARK, FAINT, HELD = "#fde3c1", "#e07b12", "#8a8f98", "#4b7f52"
_STRIP = 0.025
"""Height of the strip that marks held-out bands, relative to the axes."""
_SMOOTH = 9
"""Number of points over which the heavy line is averaged."""
_LEAST_SPAN = 50.0
"""Smallest span of the residuals' axis, so that noise alone looks small."""
_MOST_PANELS, _MOST_BARS = 6, 9
_TITLE = 100
"""Characters in a line of the title."""
_CORRECTIONS = 2.4
"""Height of the row of corrections, inches."""


def diagnosis_picture(diagnosis: Mapping[str, Any], curves: Sequence[Curve], build: Build | None, path: Path) -> Path:
    """Draw a diagnosis (the object of `diagnosis_json` and its curves) and return the path. Raises PictureError.

    Without a build there is no sketch of the device.
    """
    return save_picture(diagnosis_figure(diagnosis, curves, build), path, dpi=160)


def diagnosis_figure(diagnosis: Mapping[str, Any], curves: Sequence[Curve], build: Build | None) -> Any:
    """Return the figure; in `curves`, `start` is the fit without effects and `fitted` the fit with them."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    shown = curves[:_MOST_PANELS]
    columns = 1 if len(shown) == 1 else 2
    rows = -(-len(shown) // columns)
    bars = min(_MOST_BARS, sum(1 + len(_rivals(finding)) for finding in diagnosis["findings"])) or 1
    bottom = max(2.1, 0.9 + 0.34 * bars)
    places: Sequence[Mapping[str, Any]] = diagnosis.get("places", ())[:MOST_PANELS]
    heights = [2.9 * rows + 0.7, bottom, *([_CORRECTIONS] if places else [])]
    figure: Any = Figure(figsize=(10.5, sum(heights)), layout="constrained")
    FigureCanvasAgg(figure)
    above, below, *last = figure.subfigures(len(heights), 1, height_ratios=heights)
    panels = above.subplots(rows, columns, squeeze=False)
    named = any(not np.array_equal(curve.start, curve.fitted) for curve in curves)
    for k, axes in enumerate(panels.flat):
        if k < len(shown):
            bands: Any = diagnosis.get("held_out_Hz") or ()  # missing in older journals
            held = bands[k] if k < len(bands) else ()
            _residuals(axes, shown[k], diagnosis["findings"], held, named=named)
        else:
            axes.set_axis_off()
    entries = panels.flat[0].get_legend_handles_labels()
    above.legend(*entries, fontsize=8.5, frameon=False, ncols=6, loc="outside lower center")
    name = curves[-1].step if build is None else build.name
    title = fill(f"{name}: {diagnosis['says'][0]}", _TITLE)
    above.suptitle(as_label(title), fontweight="bold", fontsize=11.5)
    sketch, chances = below.subplots(1, 2, width_ratios=[1.15, 1.0])
    if build is None:
        sketch.set_axis_off()
    else:
        draw_sketch(sketch, build, curves[-1].step, _places(diagnosis))
    _candidates(chances, diagnosis["findings"])
    for part in last:
        part.suptitle("What is left, as a correction of the model at its likeliest places", fontsize=10)
        draw_corrections(part.subplots(1, len(places), squeeze=False)[0], places)
    return figure


def _places(diagnosis: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the places of the findings."""
    places = dict.fromkeys(str(finding["where"]) for finding in diagnosis["findings"])
    return tuple(place for place in places if place != "any")


def _rivals(finding: Mapping[str, Any]) -> list[Mapping[str, Any]]:
    return [rival for rival in finding["alternatives"] if rival["probability"] >= 0.005]


def _residuals(
    axes: Any,
    curve: Curve,
    findings: Sequence[Mapping[str, Any]],
    held: Sequence[Sequence[float]],
    *,
    named: bool,
) -> None:
    """Draw the size of the residuals over frequency: every point faint, their running mean heavy.

    `held` are the held-out bands in Hz. `named` says whether the model can include the findings.
    """
    f = curve.frequency / 1e6
    noise = noise_from_smoothness(Sweep(curve.frequency, curve.measured))
    floor = 1e-7 if noise is None else 0.2 * float(np.median(noise))
    lines = [(curve.start, BEFORE, "without the findings"), (curve.fitted, AFTER, "with them")]
    if not named:
        lines = [(curve.fitted, AFTER, "model against recording")]
    if curve.explained is not None:
        lines.append((curve.explained, EXPLAINED, "and with errors of instrument and device"))
    for Z, colour, label in lines:
        size = np.abs(np.log(Z / curve.measured))
        axes.semilogy(f, np.maximum(size, floor), color=colour, linewidth=0.5, alpha=0.35)
        axes.semilogy(f, np.maximum(_running(size), floor), color=colour, linewidth=1.5, label=label)
    if noise is not None:
        axes.fill_between(f, floor, np.sqrt(2) * noise, color="0.85", linewidth=0, zorder=0, label="noise")
    _bands(axes, curve, findings, held)
    axes.set_xlim(f[0], f[-1])
    axes.set_ylim(floor, max(axes.get_ylim()[1], _LEAST_SPAN * floor))
    axes.set_title(as_label(f"step {curve.step}"), loc="left", fontsize=9)
    axes.set_ylabel("|ln(model / measured)|", fontsize=9)
    axes.set_xlabel("frequency (MHz)", fontsize=9)
    axes.tick_params(labelsize=8.5)
    axes.spines[["top", "right"]].set_visible(False)


def _bands(axes: Any, curve: Curve, findings: Sequence[Mapping[str, Any]], held: Sequence[Sequence[float]]) -> None:
    """Mark the bands where findings show and, at the foot, the held-out bands."""
    for finding in findings:
        if finding["step"] == curve.step:
            for low, high in finding["bands_Hz"]:
                if high > curve.frequency[0] and low < curve.frequency[-1]:
                    axes.axvspan(low / 1e6, high / 1e6, color=SHOWS, linewidth=0, zorder=-1)
    for low, high in held:
        axes.axvspan(low / 1e6, high / 1e6, ymax=_STRIP, color=HELD, linewidth=0)
    if any(finding["bands_Hz"] for finding in findings):
        axes.fill_between([], [], color=SHOWS, linewidth=0, label="where it shows")
    if held:
        axes.fill_between([], [], color=HELD, linewidth=0, label="held out")


def _running(size: Reals) -> Reals:
    """Return the running root mean square, shape (N,)."""
    kernel = np.ones(_SMOOTH)
    weight = np.convolve(np.ones_like(size), kernel, mode="same")
    return np.sqrt(np.convolve(size**2, kernel, mode="same") / weight)


def _candidates(axes: Any, findings: Sequence[Mapping[str, Any]]) -> None:
    """Draw the probability of each finding and of its alternatives."""
    bars = [
        (f"{cause['effect']}, {cause['where']}", cause["probability"] or 0.0, MARK if cause is finding else FAINT)
        for finding in findings
        for cause in (finding, *_rivals(finding))
    ][:_MOST_BARS]
    if not bars:
        axes.text(0.5, 0.5, "no missing effect\nshows in this recording", ha="center", va="center", fontsize=10)
        axes.set_axis_off()
        return
    for k, (_, size, colour) in enumerate(bars):
        axes.barh(-k, size, color=colour, height=0.62)
        axes.text(size + 0.015, -k, probability_text(size), va="center", fontsize=8.5)
    axes.set_yticks([-k for k in range(len(bars))], [as_label(label) for label, *_ in bars], fontsize=8.5)
    axes.set_ylim(-max(len(bars), 3) + 0.5, 0.6)
    axes.set_xlim(0, 1.1)
    axes.set_xticks([0, 0.5, 1])
    axes.tick_params(labelsize=8.5)
    axes.set_xlabel("probability", fontsize=9)
    axes.spines[["top", "right"]].set_visible(False)
