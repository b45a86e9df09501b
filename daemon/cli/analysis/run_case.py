"""One concealed case diagnosed from its files alone, as any user's recordings are."""

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from ....models.base.errors import PzctlError


def diagnose_case(folder: Path, effects: Sequence[str] | None = None) -> dict[str, Any]:
    """Diagnose the build and the recordings in a folder as `pzctl diagnose --json` does; `seconds` beside it.

    `effects`: those to consider, None for all.
    """
    from ....drivers.recordings import read_recording
    from ....fitters.diagnosis.diagnose import diagnose
    from ....fitters.interface import FitTask
    from ....models.sweep import Sweep
    from ...files.builds.build_file import read_build
    from ...report.tables.diagnosis_output import diagnosis_json

    began = time.perf_counter()
    try:
        sweeps: dict[str, tuple[Sweep, ...]] = {}
        for file in sorted(folder.glob("*.csv"), key=lambda path: path.stem):
            step = file.stem.split("-")[0]
            sweeps[step] = (*sweeps.get(step, ()), read_recording(file))
        found = diagnosis_json(diagnose(FitTask(read_build(folder / "build.toml"), sweeps), effects))
    except PzctlError as error:
        return {"error": str(error), "seconds": time.perf_counter() - began}
    return {**found, "seconds": time.perf_counter() - began}
