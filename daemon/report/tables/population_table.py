"""The statistics of a population as a table for the terminal and as JSON."""

import math
from collections.abc import Iterator
from typing import Any

import msgspec
from rich.box import SIMPLE_HEAD
from rich.console import Console

from ....fitters.population.population_statistics import DataSheet, Population, VarianceShare
from ....fitters.population.random_effects import RandomEffects
from ....models.base.plain_numbers import signed
from .unbroken_table import Column, UnbrokenTable

_COLUMNS = (
    Column("constant"),
    Column("n", justify="right"),
    Column("mean", justify="right"),
    Column("variance", justify="right", spare=1),
    Column("sd", justify="right"),
    Column("between (95 %)", justify="right", spare=4),
    Column("within", justify="right", spare=2),
    Column("data sheet, build", justify="right", spare=3),
)
_NO_PERCENT = 0.05
"""Deviation or tolerance in per cent that would be shown as 0.0."""
_NAMED = 12
"""Greatest number of samples that the title names; more are only counted."""


def print_population(console: Console, population: Population) -> None:
    """Print the table, then outliers, samples outside a tolerance, and remarks on the statistics."""
    if population.constants:
        console.print(population_table(population))
    for sentence in (*_strange(population), *population.says):
        console.print(f"! {sentence}", style="yellow", highlight=False)


def population_table(population: Population) -> UnbrokenTable:
    """Return a table of each constant's mean, variance and standard deviation, between and within samples."""
    n = len(population.samples)
    named = f": {', '.join(population.samples)}" if n <= _NAMED else ""
    title = f"{n} sample{'' if n == 1 else 's'}{named}"
    table = UnbrokenTable(*_COLUMNS, title=title, box=SIMPLE_HEAD)
    layer = ""
    for name, part in _parts(population):
        owner = name.split(".")[0]
        if layer not in ("", owner):
            table.add_section()
        layer = owner
        table.add_row(name, *_cells(part))
    return table


def population_json(population: Population) -> dict[str, Any]:
    """Return the statistics as plain data, with the computed values `n`, `sd`, `low` and `high` included."""
    plain: dict[str, Any] = msgspec.to_builtins(population)
    for name, spread in population.constants.items():
        for key, part in (("re", spread.re), ("im", spread.im)):
            if part is not None:
                of_part: dict[str, Any] = plain["constants"][name][key]
                of_part |= {"n": part.n, "sd": part.sd}
                if part.sheet is not None:
                    of_part["sheet"] |= {"low": part.sheet.low, "high": part.sheet.high}
    return plain


def _parts(population: Population) -> Iterator[tuple[str, VarianceShare]]:
    """Yield the label of each constant, `disk.c33D re, Pa` (real constants without `re`), and its statistics."""
    for name, spread in population.constants.items():
        unit = "" if spread.unit == "1" else f", {spread.unit}"
        if spread.im is None:
            yield name + unit, spread.re
        else:
            yield f"{name} re{unit}", spread.re
            yield f"{name} im{unit}", spread.im


def _cells(part: VarianceShare) -> tuple[str, ...]:
    scatter = _short(part.variance, 2), _short(part.sd, 3), _between(part.effects), _short(part.within, 3)
    return str(part.n), _short(part.mean, 5), *scatter, _sheet(part.sheet)


def _short(value: float | None, digits: int) -> str:
    """Return a number such as `1.48e11`, or `-` for None."""
    if value is None:
        return "-"
    mantissa, e, exponent = f"{value:.{digits}g}".partition("e")
    return f"{mantissa}e{int(exponent)}" if e else mantissa


def _between(effects: RandomEffects | None) -> str:
    """Return the scatter between samples and its interval with one exponent, `4.6 (3.0..8.7)e9`."""
    if effects is None:
        return "-"
    largest = max(effects.tau, effects.tau_high / 10)  # with few samples the upper end is far out
    if largest == 0:
        return "0"
    exponent = math.floor(math.log10(largest))
    shown, digits = (0, max(0, 1 - exponent)) if -2 <= exponent <= 1 else (exponent, 1)
    tau, low, high = (f"{v / 10.0**shown:.{digits}f}" for v in (effects.tau, effects.tau_low, effects.tau_high))
    return f"{tau} ({low}..{high})" + (f"e{shown}" if shown else "")


def _sheet(sheet: DataSheet | None) -> str:
    if sheet is None or sheet.percent is None:
        return ""
    percent = f"{signed(sheet.percent, 1)} %"
    limit = 0.0 if sheet.limit is None else 100 * sheet.limit / abs(sheet.nominal)
    if limit < _NO_PERCENT:
        return "none" if abs(sheet.percent) < _NO_PERCENT else percent
    return f"{percent} of ±{limit:.0f} %" if limit >= 10 else f"{percent} of ±{limit:.1f} %"


def _strange(population: Population) -> Iterator[str]:
    """Yield a sentence for each outlier and for each constant with samples outside its tolerance."""
    for name, part in _parts(population):
        for sample, chance in part.outliers.items():
            value = next(of_sample.value for of_sample in part.values if of_sample.sample == sample)
            yield f"{name}: {sample} ({value:.5g}) is an outlier; the probability of chance is {100 * chance:.1g} %"
        if part.sheet is not None and part.sheet.outside:
            low, high = part.sheet.low, part.sheet.high
            yield f"{name}: outside the data sheet's {low:.5g} .. {high:.5g}: {', '.join(part.sheet.outside)}"
