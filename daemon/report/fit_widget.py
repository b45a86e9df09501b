"""A notebook widget for manual fits: sliders move the model's curve, and "Fit" fits with exactly these choices.

from pzctl.daemon.samples.journal_manual_fit import of_sample
from pzctl.daemon.report.fit_widget import sliders
sliders(of_sample("S4"))

Needs ipywidgets (the extra `notebook`). `ManualFit` does the same without a widget.
"""

import io
from typing import Any

import numpy as np

from ...fitters.interface import Curve, FitResult
from ...fitters.manual.adjustables import Adjustable
from ...fitters.manual.manual_fit import Choices, ManualFit, ModelPreview
from ...models.base.errors import PzctlError
from .constant_text import constant_text
from .pictures.picture_file import as_label

_STEPS = 400


class FitWidgetError(PzctlError):
    """The notebook widget cannot be made."""


def sliders(manual_fit: ManualFit, choices: Choices | None = None) -> Any:
    """Return a widget with the curves and a slider and a check box per constant. Raises FitWidgetError, FitError."""
    return FitWidget(manual_fit, choices or Choices()).box


def curve_svg(preview: ModelPreview) -> str:
    """Return |Z| and phase of measurement and model over frequency as SVG, with one column for each sweep."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure

    width, height = max(7.0, 4.6 * len(preview.curves)), 5.0
    figure: Any = Figure(figsize=(width, height))
    FigureCanvasSVG(figure)
    # Margins in inches, because matplotlib's automatic layout takes longer than the drawing.
    figure.subplots_adjust(0.85 / width, 0.5 / height, 1 - 0.1 / width, 1 - 0.65 / height, wspace=0.2, hspace=0.06)
    axes = figure.subplots(2, len(preview.curves), squeeze=False, sharex="col")
    for k, curve in enumerate(preview.curves):
        _column(axes[:, k], curve)
    axes[0, 0].set_ylabel("|Z| (Ω)")
    axes[1, 0].set_ylabel("phase (°)")
    figure.suptitle(f"chi2/dof {preview.chi2_per_dof:.3g}")
    memory = io.StringIO()
    figure.savefig(memory, format="svg")
    return memory.getvalue()


def _column(axes: Any, curve: Curve) -> None:
    f = curve.frequency / 1e6
    for z, style in ((curve.measured, {"color": "0.6", "linewidth": 2.6}), (curve.fitted, {"color": "#c8321f"})):
        axes[0].semilogy(f, np.abs(z), **style)
        axes[1].plot(f, np.angle(z, deg=True), **style)
    axes[0].set_title(as_label(f"step {curve.step}"))
    axes[1].set_xlabel("frequency (MHz)")


class FitWidget:
    """The widget and its state."""

    def __init__(self, manual_fit: ManualFit, choices: Choices) -> None:
        """Build the widget. Raises FitWidgetError if ipywidgets is not installed."""
        try:
            import ipywidgets  # type: ignore[reportMissingTypeStubs]
        except ModuleNotFoundError:
            raise FitWidgetError("ipywidgets is not installed; sliders need it: pip install ipywidgets") from None
        self._widgets: Any = ipywidgets
        self._manual_fit, self._choices = manual_fit, choices
        self.result: FitResult | None = None
        """The latest fit made here."""
        adjustables = manual_fit.look(choices).handles
        self._slider = {adjustable.name: self._new_slider(adjustable) for adjustable in adjustables}
        self._tick = {
            adjustable.name: self._widgets.Checkbox(adjustable.free, indent=False, layout={"width": "4em"})
            for adjustable in adjustables
        }
        self._button = self._widgets.Button(description="Fit", button_style="primary")
        self._picture, self._words = self._widgets.HTML(), self._widgets.HTML()
        for slider in self._slider.values():
            slider.observe(self._moved, names="value")
        self._button.on_click(self._fit)
        rows = [self._widgets.HBox([self._tick[name], slider]) for name, slider in self._slider.items()]
        left = self._widgets.VBox([*rows, self._button, self._words])
        self.box = self._widgets.HBox([left, self._picture])
        self._show()

    @property
    def choices(self) -> Choices:
        """The current choices."""
        return Choices(
            free=tuple(name for name, tick in self._tick.items() if tick.value),
            values={name: float(slider.value) for name, slider in self._slider.items()},
            bands=self._choices.bands,
            effects=self._choices.effects,
        )

    def _new_slider(self, adjustable: Adjustable) -> Any:
        look = {
            "description": f"{adjustable.name} ({adjustable.unit})",
            "style": {"description_width": "18em"},
            "layout": {"width": "40em"},
        }
        value, low, high = adjustable.value, adjustable.low, adjustable.high
        if adjustable.scale == "linear":
            return self._widgets.FloatSlider(value, min=low, max=high, step=(high - low) / _STEPS, **look)
        low, high = float(np.log10(low)), float(np.log10(high))
        return self._widgets.FloatLogSlider(value, min=low, max=high, step=(high - low) / _STEPS, **look)

    def _moved(self, _: Any) -> None:
        self._show()

    def _show(self) -> None:
        try:
            self._picture.value = curve_svg(self._manual_fit.look(self.choices))
        except PzctlError as error:
            self._words.value = str(error)

    def _fit(self, _: Any) -> None:
        try:
            self.result, fitted = self._manual_fit.fit(self.choices)
        except PzctlError as error:
            self._words.value = str(error)
            return
        for name, value in fitted.values.items():
            self._slider[name].unobserve(self._moved, names="value")
            self._slider[name].value = value
            self._slider[name].observe(self._moved, names="value")
        rows = "".join(
            f"<tr><td>{name}</td><td>{constant_text(name, c)}</td><td>{c.unit}</td></tr>"
            for name, c in self.result.constants.items()
            if c.free
        )
        self._words.value = f"chi2/dof {self.result.chi2_per_dof:.3g}<table>{rows}</table>"
        self._show()
