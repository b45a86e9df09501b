"""Oracle run: diagnose each case with only its true effects as candidates, an upper bound on performance.

It opens the truth and so runs only after all answers have been written. The errors that remain come from noise and from
the build file; no diagnosis can remove them.
"""

import json
from concurrent.futures import as_completed
from pathlib import Path
from typing import Any

from ....fitters.population.process_pool import started
from ....fitters.proof.judge import TOLD, read_judged
from .run_case import diagnose_case


def tell_all(folder: Path, published: str, jobs: int) -> None:
    """Diagnose the cases with detectable effects again, with only these effects as candidates; write the answers.

    Raises ProofError if the truth does not match the published hash.
    """
    cases = [case for case in read_judged(folder, published) if case.kind in ("one", "two")]
    effects = {case.name: tuple(finding["effect"] for finding in case.truth["findings"]) for case in cases}
    answers: dict[str, Any] = {}
    items = [(folder / "cases" / name, of_case) for name, of_case in effects.items()]
    with started(_told, items, jobs) as waiting:
        for done in as_completed(waiting):
            if done.exception() is None:  # a defect of pzctl already showed in the first answer, which is scored
                answers[waiting[done][0].name] = done.result()
    (folder / TOLD).write_text(json.dumps(dict(sorted(answers.items()))), encoding="utf-8")


def _told(case: tuple[Path, tuple[str, ...]]) -> dict[str, Any]:
    return diagnose_case(*case)
