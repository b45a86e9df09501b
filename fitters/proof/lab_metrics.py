"""The figures of a proof in the lab world, each as hits of cases, so that runs can be pooled."""

from collections.abc import Sequence
from dataclasses import dataclass
from statistics import median

from .lab_judge import LabCase
from .wilson import HitShare, share

TARGETS = {
    "dominating effect first": ">= 90 %",
    "dominating effect first, or in the class said first": "",
    "every name said right, of cases with a name": ">= 90 %",
    "names said that are right": "",
    "a wrong name said for sure": "< 2 %",
    "instrument and imperfections only: nothing wrong, not unexplained": ">= 98 %",
    "instrument only: no name, not unexplained": ">= 99 %",
    "outside the catalogue: no wrong name": "",
    "findable effects named": "",
    "95 % intervals of constants, real parts": "92 to 98 %",
    "95 % intervals of constants, imaginary parts": "92 to 98 %",
    "answered without an error": "100 %",
}
"""Figures in their order, and what they should reach."""


@dataclass(frozen=True)
class LabFigures:
    """All figures of one run, or of several pooled."""

    shares: dict[str, HitShare]
    seconds: float
    """Median for a case."""
    longest: float
    """95th percentile."""


def lab_figures(cases: Sequence[LabCase]) -> LabFigures:
    """Return the figures of a run; a case without an answer counts wherever something had to be said."""
    dominated = [case for case in cases if case.has_dominating]
    named = [case for case in cases if case.findings and not (case.is_null or case.is_outside)]
    classes = [one for case in cases for _, one in case.classes if one in ("right", "alike", "wrong")]
    silent = [case for case in cases if case.truth["kind"] == "instrument"]
    values = (
        share([case.first_is_dominating(alike=False) for case in dominated]),
        share([case.first_is_dominating(alike=True) for case in dominated]),
        share([case.all_right for case in named if any(one != "unnamed" for _, one in case.classes)]),
        share([one != "wrong" for one in classes]),
        share([case.false_and_sure for case in cases]),
        share([case.safe for case in cases if case.is_null]),
        share([case.safe and not _names(case) for case in silent]),
        share(
            [not case.failed and all(one != "wrong" for _, one in case.classes) for case in cases if case.is_outside]
        ),
        share([flag for case in cases for flag in case.found]),
        share([flag for case in cases for flag in case.covered("re")]),
        share([flag for case in cases for flag in case.covered("im")]),
        share([not case.failed for case in cases]),
    )
    times = sorted(float(case.answer.get("seconds", 0.0)) for case in cases)
    longest = times[min(int(0.95 * len(times)), len(times) - 1)] if times else 0.0
    return LabFigures(dict(zip(TARGETS, values, strict=True)), median(times) if times else 0.0, longest)


def _names(case: LabCase) -> list[str]:
    """Return the causes named that are neither the instrument's own nor none."""
    own = {"analyzer-error", "fixture-residual", "unknown", "learned"}
    return [one["effect"] for one in case.findings if one["effect"] not in own]


def said_and_right(cases: Sequence[LabCase]) -> list[tuple[float, bool]]:
    """Return probability of every name said, and whether it is right; what is allowed counts neither way."""
    return [(p, one != "wrong") for case in cases for p, one in case.classes if one in ("right", "alike", "wrong")]


@dataclass(frozen=True)
class EffectRow:
    """How one planted effect fared over all cases."""

    effect: str
    planted: int
    dominating: int
    first: int
    """Of those dominating, how often it was named first."""
    found: int
    said_wrongly: int
    """Cases in which it was named where it was not."""


def by_effect(cases: Sequence[LabCase]) -> list[EffectRow]:
    """Return a row for each effect that was planted or wrongly named."""
    from .lab_judge import matches

    names = {one["effect"] for case in cases for one in case.planted}
    names |= {one["effect"] for case in cases for one in case.findings if case.judge(one) == "wrong"}
    rows: list[EffectRow] = []
    for name in sorted(names):
        here = [(case, one) for case in cases for one in case.planted if one["effect"] == name]
        leading = [case for case, one in here if one is case.planted[0] and case.has_dominating]
        rows.append(
            EffectRow(
                effect=name,
                planted=len(here),
                dominating=len(leading),
                first=sum(case.first_is_dominating(alike=False) for case in leading),
                found=sum(any(matches(said, one) for said in case.findings) for case, one in here),
                said_wrongly=sum(
                    any(one["effect"] == name and case.judge(one) == "wrong" for one in case.findings) for case in cases
                ),
            )
        )
    return rows
