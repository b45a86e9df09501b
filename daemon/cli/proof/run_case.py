"""Diagnosis of one blind case from its files alone, as for a user's recordings."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ....models.base.errors import PzctlError


def diagnose_case(folder: Path, effects: Sequence[str] | None = None) -> dict[str, Any]:
    """Return the diagnosis of a folder's build and recordings as in `pzctl diagnose --json`, and the `seconds` it took.

    `effects` are the candidates; None stands for the whole catalogue. An error is returned under `error`.
    """
    from ....fitters.diagnosis.diagnose import diagnose
    from ...report.tables.diagnosis_output import diagnosis_json
    from ...samples.sample_selection import folder_sample

    began = time.perf_counter()
    sample = folder_sample(folder)
    if sample.job is None:
        return {"error": sample.error, "seconds": time.perf_counter() - began}
    try:
        diagnosis = diagnosis_json(diagnose(sample.job.task, effects))
    except PzctlError as error:
        return {"error": str(error), "seconds": time.perf_counter() - began}
    return {**diagnosis, "seconds": time.perf_counter() - began}
