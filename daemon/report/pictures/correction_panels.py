"""Corrections of a model as functions of frequency, one panel for each place at which they would act."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from .picture_file import as_label

REAL, IMAGINARY = "#1f5fa8", "#e07b12"
MOST_PANELS = 4


def draw_corrections(panels: Sequence[Any], places: Sequence[Mapping[str, Any]]) -> None:
    """Draw the corrections of the likeliest places into these axes, each with twice its standard uncertainty."""
    for axes, place in zip(panels, places, strict=False):
        correction = place["correction"]
        f = np.asarray(correction["frequency_Hz"], np.float64) / 1e6
        for part, colour, label in (("re", REAL, "real part"), ("im", IMAGINARY, "imaginary part")):
            value = np.asarray(correction[part], np.float64)
            band = 2 * np.asarray(correction[f"u_{part}"], np.float64)
            axes.fill_between(f, value - band, value + band, color=colour, alpha=0.2, linewidth=0)
            axes.plot(f, value, color=colour, linewidth=1.4, label=label)
        axes.axhline(0, color="#8a8f98", linewidth=0.6)
        title = f"{place['quantity']} at {place['where']}: P = {place['probability']:.2f}"
        axes.set_title(as_label(title), fontsize=9)
        axes.set_xlabel("frequency (MHz)", fontsize=8)
        axes.tick_params(labelsize=8)
    for axes in panels[len(places) :]:
        axes.set_axis_off()
    panels[0].set_ylabel("relative correction", fontsize=8)
    panels[0].legend(fontsize=7, frameon=False)
