"""The figures of the diagnosis on development cases; those of the sealed part come from `pzctl prove --seed 1000`."""

import subprocess
import sys
from pathlib import Path


def test_proof_on_development_cases(tmp_path: Path) -> None:
    words = ["-c", "from pzctl.daemon.cli import main; main()", "prove", "--count", "30", "--out", str(tmp_path)]
    run = subprocess.run([sys.executable, *words], stdout=subprocess.PIPE, text=True, check=True)
    print(run.stdout)
    assert "SHA-256 of the truth" in run.stdout
