"""Fit results as pictures."""

from pathlib import Path
from typing import Any

import numpy as np

from ....fitters.interface import Curve, FitResult
from ....models.base.arrays import Complexes, Impedances
from .picture_file import as_label, few_minor_ticks, place_no_labels, save_picture

_HEIGHT = 12.0
"""Height of the picture in inches."""
_ROWS = ("|Z| (ohm)", "phase (deg)", "G (S)", "B (S)", "residual")
_MEASURED: dict[str, Any] = {"color": "0.55", "linewidth": 2.5, "label": "measured"}
_START: dict[str, Any] = {"color": "tab:green", "linewidth": 0.9, "linestyle": "--", "label": "start"}
_FITTED: dict[str, Any] = {"color": "tab:red", "linewidth": 0.9, "label": "fitted"}


def fit_picture(result: FitResult, path: Path) -> Path:
    """Draw `fit_figure` and return the path. Raises PictureError."""
    return save_picture(fit_figure(result), path, dpi=110)


def fit_figure(result: FitResult) -> Any:
    """Return a figure of |Z|, phase, G, B and residual, with one column per sweep."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    columns = len(result.curves)
    width = max(6.0, 4.6 * columns)
    figure: Any = Figure(figsize=(width, _HEIGHT))
    FigureCanvasAgg(figure)
    axes = figure.subplots(len(_ROWS), columns, squeeze=False, sharex="col")
    # Margins in inches, because matplotlib's automatic layout takes as long as the drawing.
    figure.subplots_adjust(0.95 / width, 0.55 / _HEIGHT, 1 - 0.2 / width, 1 - 0.75 / _HEIGHT, wspace=0.2, hspace=0.1)
    place_no_labels(axes)
    for k, curve in enumerate(result.curves):
        _column(axes[:, k], curve, result.noise.relative)
        axes[0, k].set_title(as_label(curve.step), y=1.0)  # a place that is given need not be looked for
        axes[-1, k].set_xlabel("frequency (MHz)")
    for row, label in enumerate(_ROWS):
        axes[row, 0].set_ylabel(label)
    axes[0, 0].legend(fontsize="small")
    axes[-1, 0].legend(fontsize="small")
    figure.suptitle(
        f"{as_label(result.build)} by {as_label(result.fitter)}: chi2/dof {result.chi2_per_dof:.3g}, "
        f"RMS log error {result.rms_log_error:.2g}"
    )
    return figure


def _column(axes: Any, curve: Curve, noise: float) -> None:
    from matplotlib.ticker import MultipleLocator

    f = curve.frequency / 1e6
    for values, style in ((curve.measured, _MEASURED), (curve.start, _START), (curve.fitted, _FITTED)):
        axes[0].semilogy(f, np.abs(values), **style)
        axes[1].plot(f, np.angle(values, deg=True), **style)
        admittance: Impedances = 1 / values
        axes[2].semilogy(f, np.maximum(admittance.real, 1e-12), **style)
        axes[3].plot(f, admittance.imag, **style)
    for row in (0, 2):
        few_minor_ticks(axes[row])
    axes[1].yaxis.set_major_locator(MultipleLocator(45))
    ratio: Complexes = np.log(curve.fitted / curve.measured)
    axes[4].plot(f, ratio.real, linewidth=0.8, label="ln |Z_model/Z|")
    axes[4].plot(f, ratio.imag, linewidth=0.8, label="phase difference (rad)")
    axes[4].ticklabel_format(axis="y", style="sci", scilimits=(-2, 2))
    axes[4].axhspan(-2 * noise, 2 * noise, color="0.9", zorder=0, label="twice the noise")
