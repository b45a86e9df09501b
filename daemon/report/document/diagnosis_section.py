"""The report's section about a diagnosis: verdict, picture, evidence, and what remains undecided."""

from collections.abc import Sequence
from html import escape
from typing import Any

from ....fitters.interface import Curve
from ....models.base.uncertain_numbers import with_uncertainty
from ....models.build import Build
from ...samples.sample_record import StepRecord
from ..pictures.diagnosis_picture import diagnosis_figure
from ..pictures.svg_pictures import svg_of
from ..probability import probability_text
from ..tables.deviation import shift_text
from ..tables.diagnosis_output import constant_rows
from .html_table import table


def finding_places(record: StepRecord) -> tuple[str, ...]:
    """Return the places of the diagnosis's findings."""
    findings: list[dict[str, Any]] = record.diagnosis.diagnosis.get("findings", []) if record.diagnosis else []
    return tuple(str(finding.get("where")) for finding in findings)


def diagnosis_section(diagnosis: dict[str, Any], curves: Sequence[Curve], build: Build) -> str:
    """Return the section as HTML; its picture needs `curves`, which older journals do not hold."""
    says: list[str] = diagnosis.get("says") or [str(diagnosis.get("verdict", ""))]
    html = f"<p class='verdict'>Diagnosis: {escape(says[0])}</p>"
    html += "".join(f"<p>{escape(sentence)}</p>" for sentence in diagnosis.get("compared", ()))
    if curves and "findings" in diagnosis:
        html += svg_of(diagnosis_figure(diagnosis, curves, build), "diagnosis")
    return html + _findings(diagnosis) + _constants(diagnosis) + _open(diagnosis)


def _findings(diagnosis: dict[str, Any]) -> str:
    findings: list[dict[str, Any]] = diagnosis.get("findings", [])
    rows = [
        (
            str(f.get("effect")),
            str(f.get("where")),
            probability_text(f.get("probability")),
            "; ".join(_size(name, size) for name, size in f.get("parameters", {}).items()),
            _fall(f, "chi2_per_dof"),
            _fall(f, "held_out"),
            str(f.get("says", "")),
        )
        for f in findings
    ]
    heads = ("effect", "where", "probability", "size", "chi2/dof", "on held-out bands", "what it means")
    return table(heads, rows) if rows else ""


def _constants(diagnosis: dict[str, Any]) -> str:
    """Return the constants without and with the findings, if there are any."""
    heads, *rows = constant_rows(diagnosis)
    return table(heads, rows) if rows and diagnosis.get("findings") else ""


def _open(diagnosis: dict[str, Any]) -> str:
    html = ""
    hidden: list[dict[str, Any]] = diagnosis.get("not_decidable", [])
    if hidden:
        constants: dict[str, Any] = diagnosis.get("final", {}).get("constants", {})
        rows = [
            (
                str(n.get("effect")),
                str(n.get("where")),
                "; ".join(_size(name, _two_digits(size)) for name, size in n.get("upper_limit", {}).items()),
                "; ".join(
                    shift_text(name, shift, constants)
                    for name, shift in n.get("shifts", {}).items()
                    if shift is not None
                ),
                str(n.get("would_decide", "")),
            )
            for n in hidden
        ]
        heads = ("effect", "where", "at most", "would have shifted", "would decide")
        html = "<p>Could be present; the constants would hide it:</p>" + table(heads, rows)
    proposed: list[dict[str, Any]] = diagnosis.get("would_measure", [])
    if proposed:
        rows = [(str(p.get("what")), str(p.get("why")), f"{p.get('seconds', 0):.0f} s") for p in proposed]
        html += "<p>Further measurements that would decide:</p>" + table(("what", "why", "takes"), rows)
    return html


def _fall(finding: dict[str, Any], name: str) -> str:
    sides = (finding.get(f"{name}_{side}") for side in ("before", "after"))
    return " \u2192 ".join("" if side is None else f"{side:.3g}" for side in sides)


def _two_digits(limit: dict[str, Any]) -> dict[str, Any]:
    return limit if limit["value"] is None else {**limit, "value": float(f"{limit['value']:.2g}")}


def _size(name: str, size: dict[str, Any]) -> str:
    unit = size.get("unit", "")
    if size["value"] is None:
        return f"{name} unknown"
    return f"{name} {with_uncertainty(float(size['value']), size.get('u') or None)}{'' if unit == '1' else f' {unit}'}"
