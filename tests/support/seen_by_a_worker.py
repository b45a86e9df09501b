"""What the worker of a pool sees of itself, in a module that it can import."""

import multiprocessing
import os
import signal
from pathlib import Path
from typing import Any

OF_READLINE = ("COLUMNS", "LINES")
"""Variables that the library readline gives to new programs, if it is loaded."""


def seen_by_a_worker() -> dict[str, Any]:
    """Return what a worker of a pool sees of itself."""
    return {
        "forked": "forked_process" in Path("/proc/self/cmdline").read_text(encoding="utf-8"),
        "name": multiprocessing.current_process().name.partition("-")[0],
        "parent": os.getppid(),
        "folder": str(Path.cwd()),
        "variables": {name: value for name, value in os.environ.items() if name not in OF_READLINE},
        "ctrl-c": signal.getsignal(signal.SIGINT) is signal.SIG_IGN,
        "blocked": sorted(signal.pthread_sigmask(signal.SIG_BLOCK, [])),
        "terminated": signal.getsignal(signal.SIGTERM) is signal.SIG_DFL,
    }
