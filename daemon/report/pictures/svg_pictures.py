"""The pictures of a report as SVG text to be placed inside the HTML page."""

import io
import re
from collections.abc import Sequence
from typing import Any, Literal, cast

import numpy as np

from ....fitters.interface import Constant, Curve, FitResult
from ....models.base.arrays import Impedances
from ....models.build import Build
from .picture_file import as_label, few_minor_ticks, place_no_labels

MEASURED, FITTED, INK = "#8a8f98", "#c8321f", "#1f5fa8"
_KINDS = {"piezo": "#dfe7f5", "elastic": "#e9eee2"}
_MARKED = "#f6b26b"
_COLOURS = 21
"""Number of colours for correlations; with more than fifty, matplotlib draws the colour bar as an image."""
_SMALLEST_SHARE = 0.06
"""Smallest share of the width for a layer, so that a glue line of 10 um is visible beside a disk of 0.5 mm."""
_OVER_NOISE: dict[str, Any] = {"fontsize": "x-small", "framealpha": 0.9, "edgecolor": "none", "loc": "upper right"}
"""Style of a legend that lies on a noisy curve."""


def curves_svg(curves: Sequence[Curve], noise: float) -> str:
    """Return |Z|, phase, conductance and residual of each sweep, one picture per step; `noise`: relative, per point."""
    steps = dict.fromkeys(curve.step for curve in curves)
    return "".join(_step_svg([curve for curve in curves if curve.step == step], noise) for step in steps)


def _step_svg(curves: Sequence[Curve], noise: float) -> str:
    width, height = max(7.0, 4.8 * len(curves)), 8.4
    figure = _figure(width, height, layout=None)
    # Margins in inches, because matplotlib's automatic layout takes longer than the drawing.
    figure.subplots_adjust(1.05 / width, 0.5 / height, 1 - 0.1 / width, 1 - 0.35 / height, wspace=0.25, hspace=0.06)
    axes = figure.subplots(4, len(curves), squeeze=False, sharex="col", height_ratios=[1.2, 1, 1, 0.8])
    place_no_labels(axes)
    for k, curve in enumerate(curves):
        _curve(axes[:, k], curve, noise)
        axes[0, k].set_title(as_label(f"step {curve.step}"))
        axes[3, k].set_xlabel("frequency (MHz)")
    for row, label in enumerate(("|Z| (Ω)", "phase (°)", "conductance G (S)", "ln(model/measured)")):
        axes[row, 0].set_ylabel(label)
    axes[0, 0].legend(frameon=False, fontsize="small")
    axes[3, 0].legend(**_OVER_NOISE, ncols=3)
    return svg_of(figure, f"curves-{curves[0].step}")


def _curve(axes: Any, curve: Curve, noise: float) -> None:
    from matplotlib.ticker import MultipleLocator

    f = curve.frequency / 1e6
    for z, colour, width, label in ((curve.measured, MEASURED, 2.6, "measured"), (curve.fitted, FITTED, 0.9, "fitted")):
        axes[0].semilogy(f, np.abs(z), color=colour, linewidth=width, label=label)
        axes[1].plot(f, np.angle(z, deg=True), color=colour, linewidth=width)
        axes[2].semilogy(f, np.maximum(np.real(1 / z), 1e-12), color=colour, linewidth=width)
    ratio: Impedances = np.log(curve.fitted / curve.measured)
    axes[3].axhspan(-2 * noise, 2 * noise, color="0.9", zorder=0, label="twice the noise")
    axes[3].ticklabel_format(axis="y", style="sci", scilimits=(-2, 2))
    for row in (0, 2):
        few_minor_ticks(axes[row])
    axes[1].yaxis.set_major_locator(MultipleLocator(45))
    axes[3].plot(f, ratio.real, color=FITTED, linewidth=0.7, label="magnitude")
    axes[3].plot(f, ratio.imag, color=INK, linewidth=0.7, label="phase (rad)")


def circle_svg(curves: Sequence[Curve]) -> str:
    """Return the admittance circles, B over G, of each sweep."""
    columns = min(4, len(curves))
    rows = -(-len(curves) // columns)
    figure = _figure(3.2 * columns, 3.2 * rows)
    for k, curve in enumerate(curves):
        axes = figure.add_subplot(rows, columns, k + 1)
        for z, colour, width in ((curve.measured, MEASURED, 2.6), (curve.fitted, FITTED, 0.9)):
            y: Impedances = 1e3 / z
            axes.plot(y.real, y.imag, color=colour, linewidth=width)
        axes.set_title(as_label(f"step {curve.step}"))
        axes.set_xlabel("G (mS)")
        axes.set_ylabel("B (mS)")
        axes.set_aspect("equal", adjustable="datalim")
    return svg_of(figure, "circle")


def correlation_svg(pairs: Sequence[tuple[str, str, float]]) -> str:
    """Return the strong correlations as a matrix of colours; pairs that the fit separates well stay white."""
    import matplotlib as mpl

    names = list(dict.fromkeys(name for a, b, _ in pairs for name in (a, b)))
    matrix = np.full((len(names), len(names)), np.nan)
    for a, b, value in pairs:
        i, j = names.index(a), names.index(b)
        matrix[i, j] = matrix[j, i] = value
    size = 2.2 + 0.34 * len(names)
    figure = _figure(size + 1.4, size)
    axes = figure.add_subplot()
    # Few colours, so that all is vector graphics: fpdf2 misplaces an image inside an SVG.
    mesh = axes.pcolormesh(matrix, cmap=mpl.colormaps["RdBu_r"].resampled(_COLOURS), vmin=-1, vmax=1)
    for i, j in np.argwhere(
        np.isfinite(matrix)
    ):  # the sign is written too, for readers who cannot tell the colours apart
        shown = {"ha": "center", "va": "center", "color": "white" if abs(matrix[i, j]) > 0.6 else "black"}
        axes.text(j + 0.5, i + 0.5, "+" if matrix[i, j] > 0 else "\N{MINUS SIGN}", **shown)
    axes.set(aspect="equal", ylim=(len(names), 0))
    middles = np.arange(len(names)) + 0.5
    axes.set_xticks(middles, list(map(as_label, names)), rotation=90, fontsize="small")
    axes.set_yticks(middles, list(map(as_label, names)), fontsize="small")
    figure.colorbar(mesh, ax=axes, label="correlation", shrink=0.8)
    return svg_of(figure, "correlation")


def history_svg(history: dict[str, list[tuple[str, Constant]]]) -> str:
    """Return each constant (real part, with its standard uncertainty) over the steps."""
    columns = min(4, len(history))
    rows = -(-len(history) // columns)
    figure = _figure(2.9 * columns, 2.1 * rows)
    for k, (name, values) in enumerate(history.items()):
        axes = figure.add_subplot(rows, columns, k + 1)
        steps = [step for step, _ in values]
        re = np.array([constant.re for _, constant in values])
        u = np.array([constant.u_re or 0.0 for _, constant in values])
        axes.errorbar(range(len(steps)), re, yerr=u, fmt="o", color=INK, capsize=3)
        axes.set_xticks(range(len(steps)), list(map(as_label, steps)))
        axes.set_xlim(-0.5, len(steps) - 0.5)
        unit = values[0][1].unit
        axes.set_title(as_label(name if unit == "1" else f"{name} ({unit})"), fontsize="small", loc="right")
        axes.ticklabel_format(axis="y", style="sci", scilimits=(-2, 4), useOffset=False)
        axes.yaxis.get_offset_text().set_size("small")
        axes.tick_params(labelsize="small")
    return svg_of(figure, "history")


def stack_svg(build: Build, present: Sequence[str], marked: Sequence[str]) -> str:
    """Return the `present` layers, back to front, thickness to scale, with the places `marked` (`layer:disk` ...)."""
    layers = [layer for layer in build.layers if layer.name in present]
    share = np.array([layer.values["thickness"].re for layer in layers])
    width = np.maximum(share / share.sum(), _SMALLEST_SHARE)
    edges = np.concatenate([[0.0], np.cumsum(width / width.sum())])
    figure = _figure(7.5, 2.0)
    axes = figure.add_subplot()
    for layer, left, right in zip(layers, edges, edges[1:], strict=False):
        colour = _MARKED if f"layer:{layer.name}" in marked else _KINDS[layer.kind]
        axes.axvspan(left, right, color=colour, ec="0.4", lw=0.6)
        label = f"{as_label(layer.name)}\n{layer.values['thickness'].re * 1e6:.4g} µm"
        axes.text((left + right) / 2, 0.5, label, ha="center", va="center", rotation=90, fontsize="small")
        axes.text((left + right) / 2, 0.04, build.poling(layer), ha="center", va="bottom", fontsize="small")
    for where in marked:
        place = _edge(where, [layer.name for layer in layers], edges)
        if place is not None:
            axes.axvline(place, color=_MARKED, linewidth=5)
    axes.text(-0.01, 0.5, f"back: {as_label(build.back.name)}", ha="right", va="center", fontsize="small")
    axes.text(1.01, 0.5, f"front: {as_label(build.front.name)}", ha="left", va="center", fontsize="small")
    axes.set_xlim(-0.12, 1.12)
    axes.set_axis_off()
    return svg_of(figure, "stack")


def _edge(where: str, names: list[str], edges: Any) -> float | None:
    """Return the coordinate of an interface or a face, or None for a place that is no plane of the stack."""
    kind, _, place = where.partition(":")
    if kind == "face":
        return 0.0 if place == "back" else 1.0
    behind = place.partition("|")[0]
    return float(edges[names.index(behind) + 1]) if kind == "interface" and behind in names else None


def last_fits(fits: Sequence[FitResult]) -> dict[str, list[tuple[str, Constant]]]:
    """Return for each free constant the last step and the value of every fit, in the order of the fits."""
    history: dict[str, list[tuple[str, Constant]]] = {}
    for fit in fits:
        for name, constant in fit.constants.items():
            if constant.free:
                history.setdefault(name, []).append((fit.steps[-1], constant))
    return history


def _figure(width: float, height: float, layout: Literal["constrained"] | None = "constrained") -> Any:
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    figure: Any = Figure(figsize=(width, height), layout=layout)
    FigureCanvasSVG(figure)
    return figure


def svg_of(figure: Any, prefix: str) -> str:
    """Return the figure as one `<svg>`; its ids begin with `prefix`, so that a page may hold several."""
    import matplotlib as mpl

    memory, context = io.StringIO(), cast(Any, mpl).rc_context
    if (layout := figure.get_layout_engine()) is not None:
        layout.execute(figure)
        figure.set_layout_engine("none")  # or savefig would draw the figure twice, once for its layout
    with context({"svg.fonttype": "none", "svg.hashsalt": prefix}):
        figure.savefig(memory, format="svg", metadata={"Date": None}, transparent=True)
    prefix, text = re.sub(r"\W", "_", prefix), memory.getvalue()
    text = re.sub(r'(id="|href="#|url\(#)', rf"\g<1>{prefix}_", text[text.index("<svg") :])
    return re.sub(r'width="([\d.]+)pt" height="[\d.]+pt"', r'role="img" width="\1pt"', text, count=1)
