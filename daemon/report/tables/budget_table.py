"""The uncertainty budget of a fit as a table for the terminal."""

from collections.abc import Mapping

from rich.console import Console
from rich.table import Table

from ....fitters.interface import FitResult, Share


def print_budget(console: Console, result: FitResult) -> None:
    """Print the contributions to the uncertainties in per cent of each value, and the tolerances of held constants."""
    budget = result.budget
    if budget is None:
        console.print(f"{result.fitter} gives no uncertainty budget for this fit", style="yellow", highlight=False)
        return
    table = Table(header_style="bold", title="uncertainty budget, standard uncertainties")
    table.add_column("constant")
    for column in ("noise", "instrument", "model", "dimensions", "data sheets", "assumptions (not in u)"):
        table.add_column(column, justify="right")
    table.add_column("largest, beside noise")
    _rows(table, result, budget.re, "")
    _rows(table, result, budget.im, " (im)")
    console.print(table)
    if budget.tolerances:
        tolerances = ", ".join(f"{name}, +-{tolerance:.2g}" for name, tolerance in budget.tolerances.items())
        console.print(f"held constants, not in u (SI units): {tolerances}", highlight=False)


def _rows(table: Table, result: FitResult, shares: Mapping[str, Share], suffix: str) -> None:
    for name, share in shares.items():
        constant = result.constants.get(name)
        if constant is None:
            continue
        value = constant.im if suffix else constant.re
        parts = (share.noise, share.instrument, share.model, share.dimensions, share.knowledge, share.assumptions)
        percent = [f"{100 * part / abs(value):.2g} %" if value else f"{part:.2g}" for part in parts]
        table.add_row(f"{name}{suffix}", *percent, share.largest[0])
