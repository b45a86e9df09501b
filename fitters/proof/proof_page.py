"""The page that a proof becomes: figures beside their targets, reliability, confusions, everything that went wrong."""

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .judge import Judged, read_judged
from .proof_metrics import Figure, Rate, Stratum, bins, confusion, figures, rates, said, strata
from .run_list import complete
from .wilson import HitShare

PAGE = "proof.md"


def write_page(folder: Path, published: str, title: str) -> Path:
    """Score the proof in `folder` and write its page and its reliability diagram. Raises ProofError."""
    cases = read_judged(folder, published)
    pairs = said(cases)
    _draw(bins(pairs), folder / "proof-reliability.svg")
    text = "\n\n".join(
        [
            "# The proof of the diagnosis",
            f"Written by `pzctl prove`, not by hand. {title} "
            f"{len(cases)} cases; SHA-256 of their truth, printed before the first was diagnosed: `{published}`.",
            "Recordings come from `sim/blind_cases`, a world that shares no solver with the models of the fitters "
            "(the laws of "
            "a linear piezoelectric plate and of a circuit are the same). "
            "Detectable is an effect whose gain in chi2, with all free constants and the sizes of the other effects "
            "free, is above 60; it is computed by that world alone, and is no threshold of the diagnosis. What by its "
            "finding no recording of the case can tell apart counts as either: a cable too short to have a capacitance "
            "is a lead. An absorbed effect gains nothing in chi2; where it moves a constant by a part in 1000 or more, "
            "it is to be listed. Errors of constants count all that the recordings of a case cannot know (noise, the "
            "thickness and density that its build file gives); how little of them is left at best, a diagnosis shows "
            "that is told which effects are there.",
            _figures_table(figures(cases)),
            "A faint effect can bias no constant by much. Cases with one effect or two, by the chi2 per degree of "
            "freedom that a fit without them leaves:",
            _strata_table(strata(cases)),
            "Every effect by itself, where it was planted large enough to be detected:",
            _rates_table(rates(cases)),
            "## Probabilities",
            "![part that was right over probability said](proof-reliability.svg)",
            _bins_table(bins(pairs)),
            "## What was planted, what was answered",
            _confusion_table(cases),
            "## Every case that is not right",
            _failures(cases),
        ]
    )
    page = folder / PAGE
    page.write_text(text + "\n", encoding="utf-8")
    return page


def number(value: float, percent: bool = False) -> str:
    """Return a figure for the page."""
    if math.isnan(value):
        return "-"
    return f"{100 * value:.1f} %" if percent else f"{value:.3g}"


def _figures_table(rows: Sequence[Figure]) -> str:
    lines = [f"| {row.what} | {row.target} | {number(row.value, row.percent)} | {row.cases} |" for row in rows]
    return "\n".join(["| figure | target | reached | cases |", "|---|---|---|---|", *lines])


def _rates_table(rows: Sequence[Rate]) -> str:
    lines = [
        f"| {row.planted} | {row.cases} | {row.found} | {row.first} | {row.misnamed} | {row.said} |" for row in rows
    ]
    head = "| planted | cases | found | named first | another name first | said where it was not |"
    return "\n".join([head, "|---|---|---|---|---|---|", *lines])


def _strata_table(rows: Sequence[Stratum]) -> str:
    head = (
        *("chi2 before", "cases", "right", "error of the constants after / before"),
        *("the same, told which effects are there", "held-out misfit after / before"),
    )
    lines = [head, ["---"] * len(head), *map(_stratum, rows)]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _stratum(row: Stratum) -> Sequence[str]:
    high = "any" if math.isinf(row.high) else number(row.high)
    right = number(row.right, percent=True)
    ratios = (row.constants, row.constants_told, row.held_out)
    return (f"{number(row.low)} to {high}", str(row.cases), right, *map(number, ratios))


def _bins_table(rows: Sequence[tuple[int, float, float]]) -> str:
    lines = [f"| {n} | {p:.3f} | {part:.3f} |" for n, p, part in rows]
    return "\n".join(["| findings | said with | right |", "|---|---|---|", *lines])


def _confusion_table(cases: Sequence[Judged]) -> str:
    lines = ["| planted | cases | answered |", "|---|---|---|"]
    for planted, answers in confusion(cases).items():
        ranked = sorted(answers.items(), key=lambda pair: -pair[1])
        lines.append(f"| {planted} | {sum(answers.values())} | {', '.join(f'{name} {n}' for name, n in ranked)} |")
    return "\n".join(lines)


def _failures(cases: Sequence[Judged]) -> str:
    lines = ["| case | kind | planted | answered | chi2 before, after |", "|---|---|---|---|---|"]
    for case in cases:
        if not case.right or (case.kind == "absorbed" and not case.listed):
            planted = [*case.truth["findings"], *case.truth["hidden"]]
            lines.append(
                f"| {case.name} | {case.kind} | {'; '.join(map(_planted, planted)) or 'nothing'} "
                f"| {_answered(case)} | {_chi2(case.answer)} |"
            )
    return "\n".join(lines)


def _planted(one: dict[str, Any]) -> str:
    base = ", ".join(f"{name} {value * one['scale']:.2g}" for name, value in one["base"].items())
    return f"{one['effect']} @ {_cell(one['where'][0])} in {one['step']}, {base}, gain {one['gain']:.3g}"


def _answered(case: Judged) -> str:
    if "error" in case.answer:
        return _cell(str(case.answer["error"]))
    found = [
        f"{one['effect']} @ {_cell(one['where'])} ({one['probability'] or 0:.2f}"
        + "".join(f"; or {rival['effect']} {rival['probability']:.2f}" for rival in one["alternatives"][:2])
        + ")"
        for one in case.findings
    ]
    return f"{case.answer['verdict']}: {', '.join(found) or 'nothing'}"


def _cell(text: str) -> str:
    return text.replace("|", "/").replace("\n", " ")


def _chi2(answer: Any) -> str:
    return " → ".join(f"{answer[side]['chi2_per_dof'] or 0:.3g}" for side in ("baseline", "final") if side in answer)


def _draw(rows: Sequence[tuple[int, float, float]], path: Path) -> None:
    """Draw the reliability diagram: the diagonal is honest; bars are two standard errors."""
    from matplotlib.backends.backend_svg import FigureCanvasSVG
    from matplotlib.figure import Figure as Drawing

    drawing: Any = Drawing(figsize=(5, 5), layout="constrained")
    FigureCanvasSVG(drawing)
    axes = drawing.subplots()
    axes.plot([0, 1], [0, 1], color="0.6", linewidth=1)
    for n, p, part in rows:
        spread = 2 * math.sqrt(max(part * (1 - part), 1 / (4 * n)) / n)
        axes.errorbar(p, part, yerr=spread, fmt="o", color="tab:blue", capsize=3)
        axes.annotate(str(n), (p, part), textcoords="offset points", xytext=(6, -10), fontsize="small")
    axes.set(xlabel="probability said", ylabel="part that was right", xlim=(0, 1.03), ylim=(-0.05, 1.1))
    drawing.savefig(path, metadata={"Date": None})


if __name__ == "__main__":
    where, expected, words, *kept = sys.argv[1:]
    told = {"page": str(write_page(Path(where), expected, words))}
    reached = figures(read_judged(Path(where), expected))
    if kept:
        shares = {
            row.what: HitShare(round(row.value * row.cases), row.cases) for row in reached if row.percent and row.cases
        }
        complete(Path(kept[0]), expected, shares, reached[-1].value)
    plain = [asdict(row) | {"value": None if math.isnan(row.value) else row.value} for row in reached]
    print(json.dumps(told | {"figures": plain}))
