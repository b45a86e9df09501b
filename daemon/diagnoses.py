"""A diagnosis as the JSON object that `pzctl diagnose --json` prints, and as words for the terminal."""

from typing import Any

import msgspec
from rich.console import Console
from rich.table import Table

from ..fitters.diagnosis.findings import Diagnosis, Finding, Fitted, Size
from .answers import constants_json, number
from .numbers import with_uncertainty


def diagnosis_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a diagnosis as one JSON object, without the curves; a number that is missing or infinite is null."""
    return {
        "verdict": diagnosis.verdict,
        "baseline": _fitted(diagnosis.baseline),
        "final": _fitted(diagnosis.final),
        "findings": [_finding(finding) for finding in diagnosis.findings],
        "not_decidable": [msgspec.to_builtins(entry) for entry in diagnosis.not_decidable],
        "leftover": {
            "bands_Hz": [list(band) for band in diagnosis.leftover.bands_Hz],
            "chi2_per_dof": number(diagnosis.leftover.chi2_per_dof),
        },
        "says": list(diagnosis.says),
        "seconds": diagnosis.seconds,
    }


def _fitted(side: Fitted) -> dict[str, Any]:
    return {
        "chi2_per_dof": number(side.chi2_per_dof),
        "held_out": number(side.held_out),
        "constants": constants_json(side.constants),
    }


def _finding(finding: Finding) -> dict[str, Any]:
    made = msgspec.to_builtins(finding)
    numbers = ("chi2_per_dof_before", "chi2_per_dof_after", "held_out_before", "held_out_after", "probability")
    return made | {name: number(made[name]) for name in numbers}


def print_diagnosis(console: Console, diagnosis: Diagnosis) -> None:
    """Print the verdict that anyone understands, then the evidence."""
    console.print(diagnosis.says[0], style="bold", highlight=False)
    for finding in diagnosis.findings:
        console.print(f"- {finding.says}", style="yellow", highlight=False)
    if diagnosis.findings:
        console.print(_findings_table(diagnosis))
    if diagnosis.not_decidable:
        console.print("May be there unseen, because the constants absorb it:", highlight=False)
        console.print(_open_table(diagnosis))
    before, after = diagnosis.baseline, diagnosis.final
    console.print(
        f"chi2/dof {before.chi2_per_dof:.4g} -> {after.chi2_per_dof:.4g}, on bands that took no part in the fit "
        f"{before.held_out:.4g} -> {after.held_out:.4g}; {diagnosis.seconds:.1f} s",
        highlight=False,
    )


def _findings_table(diagnosis: Diagnosis) -> Table:
    table = Table(header_style="bold")
    for column in ("effect", "where", "step", "probability", "size", "chi2/dof", "bands (MHz)", "or else"):
        table.add_column(column)
    for finding in diagnosis.findings:
        bands = ", ".join(f"{low / 1e6:.3g}-{high / 1e6:.3g}" for low, high in finding.bands_Hz[:3])
        rivals = [one for one in finding.alternatives if one.probability > 0.005]
        table.add_row(
            finding.effect,
            finding.where,
            finding.step,
            f"{finding.probability:.3f}",
            "\n".join(f"{name} {_size(size)}" for name, size in finding.parameters.items()),
            f"{finding.chi2_per_dof_before:.4g} -> {finding.chi2_per_dof_after:.4g}",
            bands,
            "\n".join(f"{one.effect} at {one.where} ({one.probability:.2f})" for one in rivals),
        )
    return table


def _size(size: Size) -> str:
    return f"{with_uncertainty(size.value, size.u)}{'' if size.unit == '1' else f' {size.unit}'}"


def _open_table(diagnosis: Diagnosis) -> Table:
    table = Table(header_style="bold")
    for column in ("effect", "where", "at most", "would shift", "would decide"):
        table.add_column(column)
    for entry in diagnosis.not_decidable:
        limit = "\n".join(
            f"{name} {size.value:.2g}{'' if size.unit == '1' else f' {size.unit}'}"
            for name, size in entry.upper_limit.items()
        )
        shifts = "\n".join(f"{name} {100 * shift:+.2g} %" for name, shift in list(entry.shifts.items())[:4])
        table.add_row(entry.effect, entry.where, limit, shifts, entry.would_decide)
    return table
