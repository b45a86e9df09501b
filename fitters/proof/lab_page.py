"""The page of a proof in the lab world: figures with their intervals, all sealed runs, every case that is not right."""

import json
import math
import sys
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from .calibration import calibration, draw_reliability, reliability
from .judge import ProofError, read_sealed
from .lab_judge import LabCase
from .lab_metrics import TARGETS, LabFigures, by_effect, lab_figures, said_and_right
from .run_list import SealedRun, complete, pooled, read_runs
from .wilson import HitShare

PAGE, DIAGRAM = "proof-lab.md", "proof-lab-reliability.svg"
_WORLD = """\
Recordings come from `sim/blind_cases/lab`: random ceramics, sizes, glues and sweeps, an analyzer that errs within its
specification, a fixture's residue, imperfections of every device, and none to four effects that follow no formula of
the catalogue exactly. Waves are solved as initial-value problems by power series, distributions by adding up columns,
cables by chains of short pieces, finite disks by Ritz. The constitutive laws of a linear piezoelectric plate, of a
passive layer and of a circuit are the same as in the models: there is one nature.

What a planted effect *moves* is the root mean square of what is left of ln Z when all free constants and the sizes of
the other effects have imitated it as well as they can; what it *gains* the chi2 that is left of it where smooth gain
and phase within 0.1 % and 1 mrad and the fixture's residue help, too. *Findable* is one that gains 30 or more and
moves at least 1e-3, the analyzer's accuracy; *dominating* the one that moves most, if it gains 100 and moves
three times that. No number of the diagnosis enters. A name counts as said from a probability of 0.5, as said for sure
from 0.9. Intervals behind figures are Wilson's, 95 %; constants of one case are not independent, so theirs are too
narrow."""


def read_cases(folder: Path, published: str) -> list[LabCase]:
    """Read truth and answers of a proof. Raises ProofError where the truth is not what was published."""
    truths = read_sealed(folder, published)
    answers: dict[str, Any] = json.loads((folder / "answers.json").read_text(encoding="utf-8"))
    return [LabCase(name, truth, answers.get(name, {"error": "no answer"})) for name, truth in truths.items()]


def write_page(folder: Path, cases: Sequence[LabCase], published: str, title: str, runs: Sequence[SealedRun]) -> Path:
    """Write the page and its reliability diagram to `folder`; `runs`: the sealed ones, this one among them or not."""
    figures = lab_figures(cases)
    pairs = said_and_right(cases)
    rows = reliability(pairs)
    draw_reliability(rows, folder / DIAGRAM)
    total = pooled(runs, "lab")
    parts = [
        "# The proof of the diagnosis in the lab world",
        f"Written by `pzctl prove --world lab`, not by hand. {title} {len(cases)} cases; SHA-256 of their "
        f"truth, printed before the first was diagnosed: `{published}`.",
        _WORLD,
        _figures_table(figures, total),
        f"Seconds for a case: {figures.seconds:.1f} (median), {figures.longest:.1f} (95th percentile). "
        "What is *allowed* (a faint effect, an imperfection) counts neither as right nor as wrong; a name whose merged "
        "class holds the truth counts in the rows that say so, and as right in what follows.",
        "## Probabilities",
        _scores(pairs),
        f"![part that was right over probability said]({DIAGRAM})",
        table(("said with", "right", "findings"), [(f"{p:.3f}", str(one), str(one.of)) for p, one in rows]),
        "## Effect by effect",
        table(
            (
                "effect",
                "planted, findable",
                "named",
                "dominating",
                "of these named first",
                "cases with it wrongly named",
            ),
            [
                (r.effect, str(r.planted), str(r.found), str(r.dominating), str(r.first), str(r.said_wrongly))
                for r in by_effect(cases)
            ],
        ),
        "## All sealed runs",
        _runs_table(runs),
        "## Every case that is not right",
        _failures(cases),
    ]
    page = folder / PAGE
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return page


def _figures_table(figures: LabFigures, total: dict[str, HitShare]) -> str:
    rows = [
        (name, TARGETS[name], str(one), str(one.of), str(total.get(name, "-"))) for name, one in figures.shares.items()
    ]
    return table(("figure", "target", "reached", "of", "all sealed runs together"), rows)


def _scores(pairs: Sequence[tuple[float, bool]]) -> str:
    one = calibration(pairs)
    if not one.count:
        return "No name was said."
    skills = [f"{100 * skill:+.0f} %" if not math.isnan(skill) else "-" for skill in (one.log_skill, one.brier_skill)]
    return (
        f"{one.count} names said, {100 * one.right:.1f} % right, said with {one.said:.3f} on the average. Log score "
        f"{one.log_score:.3f} nats, {skills[0]} better than the best constant; Brier score {one.brier:.4f}, "
        f"{skills[1]}."
    )


def _runs_table(runs: Sequence[SealedRun]) -> str:
    first, second = "dominating effect first", "a wrong name said for sure"
    rows = [
        (
            run.date,
            run.world,
            str(run.seed),
            str(run.cases),
            run.commit,
            f"`{run.sha256[:12]}`",
            *(str(HitShare(*run.shares[name])) if name in run.shares else "not finished" for name in (first, second)),
        )
        for run in runs
    ]
    return table(("begun (UTC)", "world", "seed", "cases", "code", "SHA-256 of the truth", first, second), rows)


def _failures(cases: Sequence[LabCase]) -> str:
    rows: list[tuple[str, ...]] = []
    for case in cases:
        classes = [one for _, one in case.classes]
        missed = case.has_dominating and not case.first_is_dominating(alike=False)
        if missed or case.failed or "wrong" in classes or (case.is_null and not case.safe):
            planted = "; ".join(f"{one['effect']} {one['moves']:.1e}" for one in case.planted) or "nothing"
            rows.append((case.name, case.truth["kind"], planted, _answered(case)))
    return table(("case", "kind", "planted, with what it moves", "answered"), rows)


def _answered(case: LabCase) -> str:
    if case.failed:
        return str(case.answer["error"]).replace("|", "/").replace("\n", " ")
    said = [
        f"{one['effect']} @ {one['where']} ({p:.2f}, {what})".replace("|", "/")
        for one, (p, what) in zip(case.findings, case.classes, strict=True)
    ]
    return f"{case.answer['verdict']}: {', '.join(said) or 'nothing'}"


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return a table of the page."""
    return "\n".join(["| " + " | ".join(row) + " |" for row in (head, ["---"] * len(head), *rows)])


def main(folder: Path, published: str, title: str, listed: Path | None) -> dict[str, Any]:
    """Judge a proof; complete its entry in the list of sealed runs where there is one; return figures and page."""
    cases = read_cases(folder, published)
    figures = lab_figures(cases)
    if listed is not None:
        complete(listed, published, figures.shares, figures.seconds)
    page = write_page(folder, cases, published, title, read_runs(listed) if listed is not None else [])
    scores = {
        name: None if math.isnan(value) else value for name, value in asdict(calibration(said_and_right(cases))).items()
    }
    shares = {name: {"hits": one.hits, "of": one.of, "interval": one.interval} for name, one in figures.shares.items()}
    return {"page": str(page), "figures": shares, "calibration": scores, "seconds": figures.seconds}


if __name__ == "__main__":
    where, expected, words, *kept = sys.argv[1:]
    try:
        print(json.dumps(main(Path(where), expected, words, Path(kept[0]) if kept else None)))
    except ProofError as error:
        sys.exit(str(error))
