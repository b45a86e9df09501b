"""The verdict of a fit by the limits of its build: table for the terminal, JSON, and exit status."""

from typing import Any

import msgspec
from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.text import Text

from ....fitters.population.conformity import Conformity, SampleVerdict, Verdict
from ....models.base.uncertain_numbers import with_uncertainty
from .unbroken_table import Column, UnbrokenTable

EXIT_STATUS: dict[Verdict, int] = {"pass": 0, "fail": 3, "undecided": 4}
"""Exit status of a command that judged a sample."""
HEADS = ("constant", "value", "unit", "limits", "guard band", "probability", "verdict")
_SPARE = {"guard band": 1, "probability": 2}
_COLOURS = {"pass": "green", "undecided": "yellow", "fail": "bold red"}


def print_verdict(console: Console, verdict: SampleVerdict | None) -> None:
    """Print the verdict with a row for each limit; nothing if no limit applies."""
    if verdict is None:
        return
    *heads, last = HEADS
    columns = (Column(head, spare=_SPARE.get(head, 0)) for head in heads)
    table = UnbrokenTable(*columns, Column(last, prose=True), box=SIMPLE_HEAD)
    for one in verdict.limits:
        *cells, word = verdict_row(one)
        table.add_row(*cells, Text(word, style=_COLOURS[one.verdict]))
    console.print(f"verdict: {verdict.verdict}", style=_COLOURS[verdict.verdict], highlight=False)
    console.print(table)


def verdict_row(one: Conformity) -> tuple[str, ...]:
    """Return the cells of one limit, as named in `HEADS`."""
    unit = "" if one.unit == "1" else one.unit
    return (
        one.constant,
        "" if one.value is None else with_uncertainty(one.value, one.u),
        unit,
        limits_text(one.min, one.max),
        "" if one.guard is None else f"{one.guard:.2g}",
        "" if one.probability is None else f"{one.probability:.3f}",
        f"{one.verdict}: {one.says}" if one.says else one.verdict,
    )


def limits_text(low: float | None, high: float | None) -> str:
    """Return `1.46e11 .. 1.56e11`, or one end with a sign."""
    if low is None or high is None:
        return f"<= {high:.6g}" if high is not None else f">= {low:.6g}"
    return f"{low:.6g} .. {high:.6g}"


def verdict_json(verdict: SampleVerdict | None) -> dict[str, Any] | None:
    """Return the verdict as plain data, or None."""
    return None if verdict is None else msgspec.to_builtins(verdict)
