"""The page of a proof on real recordings: every part that was planted, and what was said of it."""

import json
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .judge import ProofError, read_sealed
from .lab_page import table
from .planted_judge import PlantedCase, planted_figures
from .run_list import complete

PAGE = "proof-real.md"
_TARGETS = {"named, size within 15 %": ">= 85 %"}


def read_planted(folder: Path, published: str) -> tuple[list[PlantedCase], dict[str, Any]]:
    """Return all planted cases and all answers. Raises ProofError where the truth is not what was published."""
    truths = read_sealed(folder, published)
    answers: dict[str, Any] = json.loads((folder / "answers.json").read_text(encoding="utf-8"))
    missing = {"error": "no answer"}
    cases = [
        PlantedCase(name, truth, answers.get(name, missing), answers.get(truth["bare"], missing))
        for name, truth in truths.items()
        if truth["kind"] == "planted"
    ]
    return cases, answers


def write_page(folder: Path, cases: Sequence[PlantedCase], published: str, title: str) -> Path:
    """Write the page to `folder`."""
    figures = planted_figures(cases)
    devices = len({case.truth["source"] for case in cases})
    rows = [
        (
            case.truth["source"],
            f"{case.truth['effect']}, {case.truth['parameter']} {case.truth['size']:.3g}",
            f"{100 * case.truth['moves']:.1f} %",
            "-" if case.size is None else f"{case.size:.3g}",
            "yes" if case.right else "size" if case.named else "no",
            _said(case.answer),
            _said(case.bare),
        )
        for case in cases
    ]
    head = ("recording", "planted", "moves ln Z", "said of its size", "right?", "said", "said without it")
    parts = [
        "# Parts planted in real recordings",
        f"Written by `pzctl prove --real`, not by hand. {title} {len(cases)} parts in {devices} recordings; SHA-256 of "
        f"their truth, printed before the first was diagnosed: `{published}`.",
        "Recordings of real devices, measured by others, with exact parts put onto them: two-ports at the terminals, "
        "all resonances drifting in time, a filter that follows late. What was planted is known, the device is not: "
        "what is said of the device itself counts neither way. A size is what is said with the part less what is said "
        "without it.",
        table(
            ("figure", "target", "reached", "of"),
            [(name, _TARGETS.get(name, ""), str(one), str(one.of)) for name, one in figures.items()],
        ),
        table(head, rows),
    ]
    page = folder / PAGE
    page.write_text("\n\n".join(parts) + "\n", encoding="utf-8")
    return page


def _said(answer: Any) -> str:
    if "error" in answer:
        return str(answer["error"]).replace("|", "/").replace("\n", " ")
    names = [f"{one['effect']} ({one['probability'] or 0:.2f})" for one in answer["findings"]]
    return f"{answer['verdict']}: {', '.join(names) or 'nothing'}"


def main(folder: Path, published: str, title: str, listed: Path | None) -> dict[str, Any]:
    """Judge a proof on real recordings; complete its entry in the list of sealed runs where there is one."""
    cases, answers = read_planted(folder, published)
    figures = planted_figures(cases)
    if listed is not None:
        times = sorted(float(one.get("seconds", 0.0)) for one in answers.values())
        complete(listed, published, figures, times[len(times) // 2])
    page = write_page(folder, cases, published, title)
    shares = {name: {"hits": one.hits, "of": one.of, "interval": one.interval} for name, one in figures.items()}
    return {"page": str(page), "figures": shares}


if __name__ == "__main__":
    where, expected, words, *kept = sys.argv[1:]
    try:
        print(json.dumps(main(Path(where), expected, words, Path(kept[0]) if kept else None)))
    except ProofError as error:
        sys.exit(str(error))
