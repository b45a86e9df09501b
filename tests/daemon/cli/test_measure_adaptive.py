"""`pzctl measure --adaptive`: at most two preliminary sweeps, one recording, and the same constants."""

import json
import os
import subprocess
import sys
from pathlib import Path

from pzctl.daemon.journal.journal_reader import JournalReader

PZCTL = Path(sys.executable).with_name("pzctl")


def test_an_adaptive_measurement_is_one_recording_that_gives_the_constants(tmp_path: Path) -> None:
    words = [PZCTL, "measure", "--adaptive", "--fit", "--json", "--time-scale", "0", "--step", "disk"]
    environment = {**os.environ, "PZCTL_HOME": str(tmp_path)}
    done = subprocess.run(words, env=environment, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    assert "disk: 1 preliminary sweep(s); 1" in done.stderr
    story = json.loads(done.stdout)
    (measurement,) = story["measurements"]
    assert len(measurement["sweeps"]) == 1
    (fit,) = story["fits"]
    assert 0.7 < fit["chi2_per_dof"] < 1.4
    for name, constant in fit["constants"].items():
        for part in ("re", "im"):
            if constant[f"u_{part}"]:
                assert abs(constant[part] - story["truth"][name][part]) < 4 * constant[f"u_{part}"], name
    journal = JournalReader(tmp_path / "journal")
    assert len(journal.measurements()) == 2, "the look is kept as well"
    journal.close()
