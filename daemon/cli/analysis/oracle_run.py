"""What a diagnosis reaches that is told which effects are there: the best that the recordings of a proof can give.

Asked when all answers are given and kept, as this opens the truth. What it leaves of an error is noise, and what the
build file gives, which no diagnosis takes away.
"""

import json
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from ....fitters.population.process_pool import started
from ....fitters.proof.judge import TOLD, read_judged
from .run_case import diagnose_case


def tell_all(folder: Path, published: str, jobs: int) -> None:
    """Diagnose once more the cases with detectable effects, only these considered, and keep what is answered.

    Raises ProofError where the truth is not the one whose hash was published.
    """
    cases = [case for case in read_judged(folder, published) if case.kind in ("one", "two")]
    effects = {case.name: tuple(one["effect"] for one in case.truth["findings"]) for case in cases}
    answers: dict[str, Any] = {}
    items = [(folder / "cases" / name, of_case) for name, of_case in effects.items()]
    with started(_told, items, jobs) as waiting:
        for done in as_completed(waiting):
            if done.exception() is None:  # a defect of ours has shown in the first answer, where it counts
                answers[waiting[done][0].name] = done.result()
    (folder / TOLD).write_text(json.dumps(dict(sorted(answers.items()))))


def _told(case: tuple[Path, tuple[str, ...]]) -> dict[str, Any]:
    return diagnose_case(*case)
