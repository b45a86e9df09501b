"""The figures of a proof: how often diagnoses were right, by kind, size and effect; how honest probabilities are."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from statistics import median
from typing import Any

from .judge import Judged, is_right

_TOLD_OF_THEM = "the same of a diagnosis that is told which effects are there"


@dataclass(frozen=True)
class Figure:
    """One figure of the proof beside its target."""

    what: str
    cases: int
    value: float
    target: str
    percent: bool


def figures(cases: Sequence[Judged]) -> list[Figure]:
    """Return the figures of the proof in the order of their targets."""
    of = {kind: [case for case in cases if case.kind == kind] for kind in ("none", "one", "two", "outside", "absorbed")}
    with_effect = [*of["one"], *of["two"]]
    absorbed = [case for case in of["absorbed"] if case.truth["not_decidable"]]
    ratios = _freed(with_effect)
    told = _told(with_effect)
    best = _freed(told)
    return [
        _share("nothing left out: no finding", (case.right for case in of["none"]), ">= 99 %"),
        _share("one effect, detectable: right effect and place first", (case.right for case in of["one"]), ">= 95 %"),
        _share("the same within the merged group", (case.right_in_group for case in of["one"]), ">= 99 %"),
        _share("two effects: both", (case.right for case in of["two"]), ">= 85 %"),
        _share("outside the catalogue: unknown, not a wrong name", (case.right for case in of["outside"]), ">= 90 %"),
        _share("absorbed effects: none named", (case.right for case in of["absorbed"]), "100 %"),
        _share("absorbed effects: listed in not_decidable", (case.listed for case in absorbed), "100 %"),
        Figure("error of the constants after / before, median", len(ratios), _median(ratios), "<= 0.1", False),
        Figure(f"{_TOLD_OF_THEM}: error of the constants", len(best), _median(best), "", False),
        Figure("error of the constants before, in uncertainties, median", *_off(with_effect, "baseline"), "", False),
        Figure("the same after", *_off(with_effect, "final"), "", False),
        Figure("held-out misfit after / before, median", *_held_out(with_effect), "<= 0.1", False),
        Figure(f"{_TOLD_OF_THEM}: held-out misfit", *_held_out(told), "", False),
        Figure("chi2 per degree of freedom after, median", *_chi2(with_effect), "< 1.2", False),
        Figure("said with probability p, right in p of cases: mean distance", *_distance(cases), "<= 5 %", True),
        Figure("seconds for a case, median", len(cases), _median([_seconds(case) for case in cases]), "", False),
    ]


def said(cases: Sequence[Judged]) -> list[tuple[float, bool]]:
    """Return the probability of every finding said, and whether it was right."""
    found: list[tuple[float, bool]] = []
    for case in cases:
        for finding in case.findings:
            right = any(is_right(finding, planted) for planted in case.truth["findings"])
            found.append((float(finding["probability"] or 0.0), right))
    return found


def bins(pairs: Sequence[tuple[float, bool]]) -> list[tuple[int, float, float]]:
    """Return, for each bin of probability that is not empty: how many, mean probability said, part that was right."""
    edges = (0.0, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 1.01)
    found: list[tuple[int, float, float]] = []
    for low, high in pairwise(edges):
        inside = [(p, right) for p, right in pairs if low <= p < high]
        if inside:
            n = len(inside)
            found.append((n, sum(p for p, _ in inside) / n, sum(right for _, right in inside) / n))
    return found


def confusion(cases: Sequence[Judged]) -> dict[str, dict[str, int]]:
    """Return how often each planted effect (detectable ones, and `nothing`) was answered by which effects."""
    table: dict[str, dict[str, int]] = {}
    for case in cases:
        planted = " + ".join(sorted(one["effect"] for one in case.truth["findings"])) or "nothing"
        row = table.setdefault(f"{planted} ({case.kind})" if case.kind in ("faint", "absorbed") else planted, {})
        answer = " + ".join(sorted(one["effect"] for one in case.findings)) or "nothing"
        answer = "error" if "error" in case.answer else answer
        row[answer] = row.get(answer, 0) + 1
    return dict(sorted(table.items()))


@dataclass(frozen=True)
class Rate:
    """How often one effect, or one kind of flaw that no catalogue has, was found where it was planted."""

    planted: str
    cases: int
    found: int
    """Among the findings."""
    first: int
    """As the first finding."""
    misnamed: int
    """The first finding is wrong."""
    said: int
    """How often it was named in all cases where it was not planted."""


def rates(cases: Sequence[Judged]) -> list[Rate]:
    """Return the rates of all planted effects, those of no catalogue by kind, in alphabetical order."""
    rows: dict[str, list[tuple[Judged, Mapping[str, Any]]]] = {}
    for case in cases:
        if case.kind in ("one", "two", "outside"):
            for planted in case.truth["findings"]:
                kind = next(iter(planted["base"]), "")
                name = f"unknown: {kind}" if planted["effect"] == "unknown" else planted["effect"]
                rows.setdefault(name, []).append((case, planted))
    return [_rate(name, rows[name], cases) for name in sorted(rows)]


def _rate(name: str, planted: Sequence[tuple[Judged, Mapping[str, Any]]], cases: Sequence[Judged]) -> Rate:
    effect = name.partition(":")[0]
    firsts = [case.findings[0] if case.findings else None for case, _ in planted]
    wrong = [
        first is not None and not any(is_right(first, one) for one in case.truth["findings"])
        for (case, _), first in zip(planted, firsts, strict=True)
    ]
    elsewhere = [
        case
        for case in cases
        if all(effect not in (one["effect"], *one["accept"]) for one in case.truth["findings"])
        and any(found["effect"] == effect for found in case.findings)
    ]
    return Rate(
        planted=name,
        cases=len(planted),
        found=sum(any(is_right(found, one) for found in case.findings) for case, one in planted),
        first=sum(first is not None and is_right(first, one) for first, (_, one) in zip(firsts, planted, strict=True)),
        misnamed=sum(wrong),
        said=len(elsewhere),
    )


@dataclass(frozen=True)
class Stratum:
    """Cases with effects whose fit without them leaves a chi2 per degree of freedom in one range."""

    low: float
    high: float
    cases: int
    right: float
    constants: float
    """Error of the constants after / before, median."""
    constants_told: float
    """The same of a diagnosis that is told which effects are there."""
    held_out: float
    """Misfit on bands held out after / before, median."""


def strata(cases: Sequence[Judged]) -> list[Stratum]:
    """Return how cases with one detectable effect or two came out, by how much of the misfit is left without them."""
    edges = (0.0, 1.25, 3.0, 30.0, float("inf"))
    found: list[Stratum] = []
    for low, high in pairwise(edges):
        inside = [
            case
            for case in cases
            if case.kind in ("one", "two")
            and "baseline" in case.answer
            and low <= (case.answer["baseline"]["chi2_per_dof"] or 0.0) < high
        ]
        if inside:
            right = sum(case.right for case in inside) / len(inside)
            of_constants, best = _median(_freed(inside)), _median(_freed(_told(inside)))
            found.append(Stratum(low, high, len(inside), right, of_constants, best, _held_out(inside)[1]))
    return found


def _told(cases: Sequence[Judged]) -> list[Judged]:
    """Return the cases with the answers of a diagnosis that was told which effects are there, where there is one."""
    return [replace(case, answer=case.told) for case in cases if "final" in case.told]


def _freed(cases: Sequence[Judged]) -> list[float]:
    """Return the error of the constants after over that before, of the cases that have both."""
    return [
        after / before
        for case in cases
        if (after := case.error_of_constants("final")) is not None and (before := case.error_of_constants("baseline"))
    ]


def _off(cases: Sequence[Judged], side: str) -> tuple[int, float]:
    found = [off for case in cases if (off := case.deviation_of_constants(side)) is not None]
    return len(found), _median(found)


def _share(what: str, right: Iterable[bool], target: str) -> Figure:
    all_of = list(right)
    return Figure(what, len(all_of), sum(all_of) / len(all_of) if all_of else float("nan"), target, True)


def _median(values: Sequence[float]) -> float:
    return median(values) if values else float("nan")


def _held_out(cases: Sequence[Judged]) -> tuple[int, float]:
    pairs = [(c.answer["final"]["held_out"], c.answer["baseline"]["held_out"]) for c in cases if "final" in c.answer]
    ratios = [after / before for after, before in pairs if after is not None and before]
    return len(ratios), _median(ratios)


def _chi2(cases: Sequence[Judged]) -> tuple[int, float]:
    found = [case.answer["final"]["chi2_per_dof"] for case in cases if "final" in case.answer]
    return len(found), _median([one for one in found if one is not None])


def _distance(cases: Sequence[Judged]) -> tuple[int, float]:
    pairs = said(cases)
    gaps = [n * abs(p - part) for n, p, part in bins(pairs)]
    return len(pairs), sum(gaps) / len(pairs) if pairs else float("nan")


def _seconds(case: Judged) -> float:
    return float(case.answer.get("seconds", 0.0))
