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
    from ....drivers.recordings import read_recording
    from ....fitters.diagnosis.diagnose import diagnose
    from ....fitters.interface import FitTask
    from ....models.sweep import Sweep
    from ...files.builds.build_file import read_build
    from ...report.tables.diagnosis_output import diagnosis_json
    from ...samples.sample_selection import in_order

    began = time.perf_counter()
    try:
        sweeps: dict[str, tuple[Sweep, ...]] = {}
        for file in in_order(folder.glob("*.csv")):
            step = file.stem.split("-")[0]
            sweeps[step] = (*sweeps.get(step, ()), read_recording(file))
        diagnosis = diagnosis_json(diagnose(FitTask(read_build(folder / "build.toml"), sweeps), effects))
    except PzctlError as error:
        return {"error": str(error), "seconds": time.perf_counter() - began}
    return {**diagnosis, "seconds": time.perf_counter() - began}
