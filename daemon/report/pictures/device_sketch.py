"""A sketch of the transducer at its step, its leads and the analyzer, with the places of the findings marked."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....models.build import Build, LayerSpec
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
        label = as_label(layer.name)
        axes.text(middle, (_LOW + _HIGH) / 2, label, ha="center", va="center", rotation=turned, fontsize=9)
        axes.text(middle, _LOW + 0.01, build.poling(layer), ha="center", va="bottom", fontsize=9)
    if build.bolt is not None and build.bolt.acts_in(present):
        ends = edges[names.index(build.bolt.behind) + 1] - 0.03, edges[names.index(build.bolt.before)] + 0.03
        axes.plot(ends, [_HIGH - 0.04] * 2, color=_INK, linewidth=3.0, solid_capstyle="butt")
    _analyzer(axes, _electrodes(build, layers, edges), marked)
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


def _electrodes(build: Build, layers: Sequence[LayerSpec], edges: Any) -> tuple[list[float], list[float]]:
    """Return the coordinates of the electrodes at the one and at the other terminal.

    In parallel, facing electrodes of neighbours are at the same terminal.
    """
    faces = [
        (float(left), float(right))
        for layer, left, right in zip(layers, edges, edges[1:], strict=False)
        if layer.kind == "piezo"
    ]
    if build.connection == "series":
        return [faces[0][0]], [faces[-1][1]]
    turned = [face if k % 2 == 0 else face[::-1] for k, face in enumerate(faces)]
    return sorted({face[0] for face in turned}), sorted({face[1] for face in turned})


def _analyzer(axes: Any, electrodes: tuple[Sequence[float], Sequence[float]], marked: Sequence[str]) -> None:
    """Draw the leads from the electrodes at each terminal to the analyzer above them."""
    from matplotlib.patches import FancyBboxPatch

    ends = [*electrodes[0], *electrodes[1]]
    middle, half = (min(ends) + max(ends)) / 2, 0.15
    lead = _MARK if "terminals" in marked else _INK
    thick = 2.6 if "terminals" in marked else 1.0
    single = len(ends) == 2
    for terminal, side, low in zip(electrodes, (-1, 1), (0.0, 0.0) if single else (-0.14, -0.2), strict=True):
        wire, outer = _WIRE + 0.08 + low, middle + side * half
        if single:
            axes.plot([*terminal, *terminal, outer], [_HIGH, wire, wire], color=lead, linewidth=thick)
            continue
        for face in terminal:
            axes.plot([face, face], [_HIGH, wire], color=lead, linewidth=thick)
        axes.plot([min(*terminal, outer), max(*terminal, outer)], [wire, wire], color=lead, linewidth=thick)
        axes.plot([outer, outer], [wire, _WIRE + 0.08], color=lead, linewidth=thick)
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
