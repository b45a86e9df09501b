"""Tests can interrupt their child processes even where pytest ignores Ctrl-C, under `nohup` or `&` in a script."""

import subprocess
import sys
from pathlib import Path

CHILD = "import signal; print(signal.getsignal(signal.SIGINT) is signal.default_int_handler)"
UNDER_NOHUP = f"""
import signal, runpy, subprocess, sys
signal.signal(signal.SIGINT, signal.SIG_IGN)
sys.path.append(sys.argv[2])
runpy.run_path(sys.argv[1])
subprocess.run([sys.executable, "-c", {CHILD!r}], check=True)
"""


def test_children_can_be_interrupted_where_pytest_ignores_ctrl_c() -> None:
    here = Path(__file__).parent
    words = [sys.executable, "-c", UNDER_NOHUP, str(here / "conftest.py"), str(here / "support")]
    assert subprocess.run(words, capture_output=True, text=True, check=True).stdout == "True\n"
