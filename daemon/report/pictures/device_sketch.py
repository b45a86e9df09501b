"""A sketch of the transducer at its step, its leads and the analyzer, with the places of the findings marked."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....models.build import Build
from .picture_file import as_label

_COLOURS = {"piezo": "#dfe7f5", "elastic": "#e9eee2"}
_MARKED, _MARK, _INK = "#fbc98b", "#e07b12", "#3a3f46"
_THINNEST = 0.07
"""Smallest share of the width for a layer, so that a glue line is visible beside a disk."""
_LOW, _HIGH, _WIRE = 0.22, 0.68, 0.86


def draw_sketch(axes: Any, build: Build, at: str, marked: Sequence[str]) -> None:
    """Draw the layers of the step `at`, back to front, with the places `marked` (`layer:disk`, `terminals` ...)."""
    from matplotlib.patches import Rectangle

    present = next(step.layers for step in build.steps if step.name == at)
    layers = [layer for layer in build.layers if layer.name in present]
    names = [layer.name for layer in layers]
    share = np.array([layer.values["thickness"].re for layer in layers]) ** 0.6
    width = np.maximum(share / share.sum(), _THINNEST)
    edges = np.concatenate([[0.0], np.cumsum(width / width.sum())])
    for layer, left, right in zip(layers, edges, edges[1:], strict=False):
        colour = _MARKED if f"layer:{layer.name}" in marked else _COLOURS[layer.kind]
        box = Rectangle((left, _LOW), right - left, _HIGH - _LOW, facecolor=colour, edgecolor=_INK, linewidth=0.8)
        axes.add_patch(box)
        turned = 90 if right - left < 0.16 else 0
        middle = (left + right) / 2
        axes.text(
            middle, (_LOW + _HIGH) / 2, as_label(layer.name), ha="center", va="center", rotation=turned, fontsize=9
        )
    _analyzer(axes, layers, edges, marked)
    for where in marked:
        place = _plane(where, names, edges)
        if place is not None:
            axes.plot([place, place], [_LOW - 0.05, _HIGH + 0.05], color=_MARK, linewidth=4.5, solid_capstyle="butt")
    says = "marked: " + ", ".join(marked) if marked else ""
    axes.text(0.5, 0.02, as_label(says), ha="center", va="bottom", fontsize=9, color=_MARK if marked else _INK)
    axes.text(-0.02, (_LOW + _HIGH) / 2, as_label(build.back.name), ha="right", va="center", fontsize=9, color=_INK)
    axes.text(1.02, (_LOW + _HIGH) / 2, as_label(build.front.name), ha="left", va="center", fontsize=9, color=_INK)
    axes.text(0.0, _LOW - 0.03, "back", ha="left", va="top", fontsize=8, color=_INK)
    axes.text(1.0, _LOW - 0.03, "front", ha="right", va="top", fontsize=8, color=_INK)
    axes.set_xlim(-0.18, 1.18)
    axes.set_ylim(0, 1.12)
    axes.set_axis_off()


def _analyzer(axes: Any, layers: Sequence[Any], edges: Any, marked: Sequence[str]) -> None:
    """Draw the leads from the faces of the piezoelectric layer to the analyzer above it."""
    from matplotlib.patches import FancyBboxPatch

    piezo = next((k for k, layer in enumerate(layers) if layer.kind == "piezo"), 0)
    left, right = float(edges[piezo]), float(edges[piezo + 1])
    middle, half = (left + right) / 2, 0.15
    lead = _MARK if "terminals" in marked else _INK
    thick = 2.6 if "terminals" in marked else 1.0
    for face, side in ((left, -1), (right, 1)):
        outer = middle + side * half
        axes.plot([face, face, outer], [_HIGH, _WIRE + 0.08, _WIRE + 0.08], color=lead, linewidth=thick)
    box = FancyBboxPatch(
        (middle - half, _WIRE),
        2 * half,
        0.16,
        boxstyle="round,pad=0.01",
        facecolor=_MARKED if "sweep" in marked else "white",
        edgecolor=_MARK if "sweep" in marked else _INK,
        linewidth=1.0,
        zorder=3,
    )
    axes.add_patch(box)
    axes.text(middle, _WIRE + 0.08, "analyzer", ha="center", va="center", fontsize=8.5, zorder=4)


def _plane(where: str, names: Sequence[str], edges: Any) -> float | None:
    """Return the coordinate of an interface or a face, or None for a place that is no plane of the stack."""
    if where in ("face:back", "face:front"):
        return 0.0 if where == "face:back" else 1.0
    behind, _, before = where.removeprefix("interface:").partition("|")
    if not where.startswith("interface:") or behind not in names or before not in names:
        return None
    return float(edges[names.index(behind) + 1] + edges[names.index(before)]) / 2
