"""A diagnosis as the JSON object that `pzctl diagnose --json` prints, and as text for the terminal."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import msgspec
from rich.console import Console

from ....fitters.diagnosis.data_quality.data_issues import DataCheck
from ....fitters.diagnosis.findings import Diagnosis, Finding, FitSummary
from ....fitters.interface import Curve
from ....models.base.uncertain_numbers import complex_with_uncertainty, with_uncertainty
from ..json_output.fit_json import constants_json, number
from ..probability import probability_text
from .deviation import shift_text
from .unbroken_table import Column, UnbrokenTable


def diagnosis_json(diagnosis: Diagnosis) -> dict[str, Any]:
    """Return a diagnosis as one JSON object without the curves; a missing or infinite number becomes null."""
    return {
        "verdict": diagnosis.verdict,
        "baseline": _fitted(diagnosis.baseline),
        "final": _fitted(diagnosis.final),
        "findings": [_finding(finding) for finding in diagnosis.findings],
        "remarks": [_finding(finding) for finding in diagnosis.remarks],
        "remaining": msgspec.to_builtins(diagnosis.remaining),
        "not_decidable": [msgspec.to_builtins(entry) for entry in diagnosis.not_decidable],
        "places": [msgspec.to_builtins(place) for place in diagnosis.places],
        "data": [_check(check) for check in diagnosis.data],
        "held_out_Hz": msgspec.to_builtins(diagnosis.held_out_Hz),
        "others": [msgspec.to_builtins(other) | {"says": other.says} for other in diagnosis.others],
        "leftover": msgspec.to_builtins(diagnosis.leftover) | {"chi2_per_dof": number(diagnosis.leftover.chi2_per_dof)},
        "says": list(diagnosis.says),
        "seconds": diagnosis.seconds,
    }


def _fitted(side: FitSummary) -> dict[str, Any]:
    return {
        "chi2_per_dof": number(side.chi2_per_dof),
        "held_out": number(side.held_out),
        "constants": constants_json(side.constants),
    }


def _check(check: DataCheck) -> dict[str, Any]:
    """Return the data-quality check of one recording, with a sentence for each issue."""
    troubles = [msgspec.to_builtins(trouble) | {"says": trouble.says} for trouble in check.troubles]
    return msgspec.to_builtins(check) | {"troubles": troubles}


def _finding(finding: Finding) -> dict[str, Any]:
    fields = msgspec.to_builtins(finding)
    numbers = ("chi2_per_dof_before", "chi2_per_dof_after", "held_out_before", "held_out_after", "probability")
    numbers = (*numbers, "share", "moves")
    return fields | {name: number(fields[name]) for name in numbers}


def diagnosis_curves(diagnosis: Diagnosis) -> tuple[Curve, ...]:
    """Return the curves of each recording: `start` is the fit without effects, `fitted` the fit with them."""
    return tuple(
        replace(after, start=before.fitted) for before, after in zip(diagnosis.before, diagnosis.after, strict=True)
    )


def print_diagnosis(console: Console, diagnosis: Mapping[str, Any]) -> None:
    """Print a diagnosis (the object of `diagnosis_json`): first the verdict as a sentence, then the evidence."""
    console.print(diagnosis["says"][0], style="bold", highlight=False)
    findings: list[dict[str, Any]] = diagnosis["findings"]
    for finding in findings:
        console.print(f"- {finding['where']}: {finding['says']}", style="yellow", highlight=False)
    for check in diagnosis["data"]:
        for trouble in check["troubles"]:
            says = f"recording {check['index'] + 1} of {check['step']}: {trouble['says']}"
            console.print(f"- {says}", style="magenta", highlight=False)
    for one in diagnosis.get("remarks", ()):
        says = f"{one['where']}: {one['says']} It changes Z by {100 * one['moves']:.2g} % (rms) and no constant"
        console.print(f"- remark, no mismatch: {says} by its uncertainty.", style="dim", highlight=False)
    for sentence in (*diagnosis.get("compared", ()), *(other["says"] for other in diagnosis.get("others", ()))):
        console.print(f"- {sentence}", highlight=False)
    if findings:
        console.print(_findings_table(findings))
    if diagnosis["not_decidable"]:
        console.print("Could be present; the constants would hide it:", highlight=False)
        console.print(_open_table(diagnosis["not_decidable"], diagnosis["final"].get("constants", {})))
    seconds = f"{diagnosis['seconds']:.1f} s"
    if findings:
        before, after = diagnosis["baseline"], diagnosis["final"]
        held_out = f", held-out points: {_fall(before, after, 'held_out')}" if after["held_out"] else ""
        seconds = f"chi2/dof {_fall(before, after, 'chi2_per_dof')}{held_out}; {seconds}"
    console.print(seconds, highlight=False)


def print_constants(console: Console, diagnosis: Mapping[str, Any]) -> None:
    """Print the constants of a diagnosis (the object of `diagnosis_json`), and what is said of their uncertainties."""
    console.print(constants_table(diagnosis))
    for sentence in diagnosis["says"][1 + len(diagnosis["findings"]) :]:
        console.print(sentence, highlight=False)


def constants_table(diagnosis: Mapping[str, Any]) -> UnbrokenTable:
    """Return the constants without and with the findings of a diagnosis."""
    heads, *rows = constant_rows(diagnosis)
    table = UnbrokenTable(*heads, title="Constants")
    for row in rows:
        table.add_row(*row)
    return table


def constant_rows(diagnosis: Mapping[str, Any]) -> list[tuple[str, ...]]:
    """Return the fitted constants without and with the findings as rows of text, their heads first."""
    named = any(finding["effect"] not in ("unknown", "polarity") for finding in diagnosis.get("findings") or ())
    before: Mapping[str, Any] = diagnosis.get("baseline") or {}
    with_them: Mapping[str, Any] = diagnosis.get("final") or {}
    earlier: Mapping[str, Any] = before.get("constants", {})
    final: Mapping[str, Any] = with_them.get("constants", {})
    heads = ("constant", *(("without the findings",) if named else ()), "with them" if named else "fitted", "unit")
    rows: list[tuple[str, ...]] = [heads]
    for name, after in final.items():
        if after.get("free"):
            sides = (earlier.get(name), after) if named else (after,)
            rows.append((name, *(_constant(side) if side else "" for side in sides), after.get("unit", "")))
    return rows


def _constant(told: Mapping[str, Any]) -> str:
    """Return a constant with its uncertainty; an infinite or missing number is None in a message."""
    if told.get("re") is None:
        return "infinite"
    return complex_with_uncertainty(told["re"], told.get("im") or 0.0, told.get("u_re"), told.get("u_im"))


def _findings_table(findings: Sequence[Mapping[str, Any]]) -> UnbrokenTable:
    rivalled = any(_rivals(finding) for finding in findings)
    bands = Column("bands (MHz)", prose=True)
    columns = ("effect", "where", "step", "probability", "size", "chi2/dof", bands)
    table = UnbrokenTable(*columns, *(("or else",) if rivalled else ()))
    for finding in findings:
        bands = ", ".join(f"{low / 1e6:.3g}-{high / 1e6:.3g}" for low, high in finding["bands_Hz"][:3])
        before, after = ({"chi2": finding[f"chi2_per_dof_{side}"]} for side in ("before", "after"))
        table.add_row(
            finding["effect"],
            finding["where"],
            finding["step"],
            probability_text(finding["probability"]),
            "\n".join(f"{name} {_size(size)}" for name, size in finding["parameters"].items()),
            _fall(before, after, "chi2"),
            bands,
            *(["\n".join(_rivals(finding))] if rivalled else []),
        )
    return table


def _rivals(finding: Mapping[str, Any]) -> list[str]:
    """Return the alternatives to a finding, each with its probability."""
    rivals = [rival for rival in finding["alternatives"] if rival["probability"] > 0.005]
    return [f"{rival['effect']} at {rival['where']} ({rival['probability']:.2f})" for rival in rivals]


def _fall(before: Mapping[str, Any], after: Mapping[str, Any], name: str) -> str:
    return " -> ".join("infinite" if side[name] is None else f"{side[name]:.4g}" for side in (before, after))


def _size(size: Mapping[str, Any]) -> str:
    return f"{with_uncertainty(size['value'], size['u'])}{_unit(size)}"


def _unit(size: Mapping[str, Any]) -> str:
    return "" if size["unit"] == "1" else f" {size['unit']}"


def _open_table(entries: Sequence[Mapping[str, Any]], constants: Mapping[str, Any]) -> UnbrokenTable:
    table = UnbrokenTable("effect", "where", "at most", "would shift", Column("would decide", prose=True))
    for entry in entries:
        limit = "\n".join(f"{name} {size['value']:.2g}{_unit(size)}" for name, size in entry["upper_limit"].items())
        shifted: list[tuple[str, float]] = list(entry["shifts"].items())[:4]
        shifts = "\n".join(shift_text(name, shift, constants) for name, shift in shifted)
        table.add_row(entry["effect"], entry["where"], limit, shifts, entry["would_decide"])
    return table
