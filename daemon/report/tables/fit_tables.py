"""Fit results as tables for the terminal."""

from rich.console import Console
from rich.text import Text

from ....fitters.interface import Constant, FitResult
from ....fitters.population.conformity import judged
from ....models.base.uncertain_numbers import complex_with_uncertainty
from ....models.build import Build, Quantity
from ..constant_text import constant_text
from .deviation import deviation
from .unbroken_table import Column, UnbrokenTable
from .verdict_table import print_verdict

_COLOURS = {"near": "green", "off": "yellow", "far": "bold red"}
_DERIVED_SHOWN = frozenset({"kt", "kp", "Qm", "tan_delta", "c33", "compliance", "delay"})
"""The derived constants that the table shows."""


def fit_table(result: FitResult, build: Build | None) -> UnbrokenTable:
    """Return the table of a fit: constants with uncertainties, beside their data sheet values if there are any."""
    nominal = build.data_sheet if build is not None else {}
    compared = any(name in nominal for name in result.constants)
    sheet, away = Column("data sheet, build", spare=1), Column("deviation", justify="right", spare=2)
    table = UnbrokenTable("constant", "fitted", "unit", *((sheet, away) if compared else ()))
    for layer in dict.fromkeys(name.split(".")[0] for name in result.constants):
        for name, constant in result.constants.items():
            if name.split(".")[0] == layer:
                _row(table, name, constant, nominal.get(name), compared=compared)
        _derived_rows(table, result, layer)
        table.add_section()
    return table


def derived_shown(result: FitResult) -> dict[str, Constant]:
    """Return the derived constants that a table shows."""
    return {name: constant for name, constant in result.derived.items() if name.split(".")[-1] in _DERIVED_SHOWN}


def print_fit(console: Console, result: FitResult, build: Build | None) -> None:
    """Print the figures of merit, the table of constants, the verdict if there are limits, and the fitter's remarks."""
    console.print(_title(result), style="bold", highlight=False)
    console.print(fit_table(result, build))
    print_verdict(console, judged(result, build))
    for sentence in result.says:
        console.print(f"! {sentence}", style="yellow", highlight=False)


def _title(result: FitResult) -> str:
    quality = f"chi2/dof {result.chi2_per_dof:.3g}, RMS log error {result.rms_log_error:.2g}"
    noise = f"noise {result.noise.relative:.1e} ({result.noise.source})"
    steps = " + ".join(result.steps)
    return f"{result.build}: {steps} by {result.fitter} - {quality}, {noise}, {result.seconds:.2f} s"


def _row(table: UnbrokenTable, name: str, constant: Constant, nominal: Quantity | None, *, compared: bool) -> None:
    fitted = constant_text(name, constant)
    sheet = complex_with_uncertainty(nominal.re, nominal.im, nominal.u, nominal.u_im) if nominal is not None else ""
    words, verdict = deviation(name, constant, nominal)
    away = Text(words, style=_COLOURS.get(verdict, ""))
    cells = (sheet, away) if compared else ()
    table.add_row(name, fitted, constant.unit, *cells, style=None if constant.free else "dim")


def _derived_rows(table: UnbrokenTable, result: FitResult, layer: str) -> None:
    for name, constant in derived_shown(result).items():
        if name.split(".")[0] != layer:
            continue
        table.add_row(f"  {name}", constant_text(name, constant), constant.unit, style="italic")
