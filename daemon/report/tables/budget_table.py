"""The uncertainty budget of a fit as a table for the terminal."""

from collections.abc import Mapping

from rich.console import Console

from ....fitters.interface import FitResult, Share
from .unbroken_table import Column, UnbrokenTable


def print_budget(console: Console, result: FitResult) -> None:
    """Print the contributions to the uncertainties in per cent of each value, and the tolerances of held constants.

    The contributions to a value that is zero within its uncertainty are in its own unit.
    """
    budget = result.budget
    if budget is None:
        console.print(f"{result.fitter} gives no uncertainty budget for this fit", style="yellow", highlight=False)
        return
    kinds = ("noise", "instrument", "model", "dimensions", "data sheets", "assumptions (not in u)")
    parts = (Column(kind, justify="right") for kind in kinds)
    title = "uncertainty budget, standard uncertainties"
    table = UnbrokenTable("constant", *parts, Column("largest, beside noise", prose=True), title=title)
    _rows(table, result, budget.re, "")
    _rows(table, result, budget.im, " (im)")
    console.print(table)
    shares = [*budget.re.values(), *budget.im.values()]
    if not any(share.instrument or share.model for share in shares):
        says = "this fit does not tell errors of instrument and model apart: what they leave counts as noise"
        console.print(says, highlight=False)
    if budget.tolerances:
        tolerances = ", ".join(f"{name}, +-{tolerance:.2g}" for name, tolerance in budget.tolerances.items())
        console.print(f"held constants, not in u (SI units): {tolerances}", highlight=False)


def _rows(table: UnbrokenTable, result: FitResult, shares: Mapping[str, Share], suffix: str) -> None:
    for name, share in shares.items():
        constant = result.constants.get(name)
        if constant is None:
            continue
        value, u = (constant.im, constant.u_im) if suffix else (constant.re, constant.u_re)
        parts = (share.noise, share.instrument, share.model, share.dimensions, share.knowledge, share.assumptions)
        relative = abs(value) > (u or 0.0)  # of a value that is zero within its u, in its unit
        percent = [f"{100 * part / abs(value):.2g} %" if relative else f"{part:.2g}" for part in parts]
        table.add_row(f"{name}{suffix}", *percent, share.largest[0])
