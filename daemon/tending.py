"""Runs one guest process to its end, and ends it where it hangs; the daemon's loop goes on meanwhile."""

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from .children import end_child, kill_child, last_line, start_child

ONE_THREAD: dict[str, str] = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""So that fitters side by side do not fight over the cores."""


@dataclass(frozen=True)
class End:
    """How a process ended: its exit status (negative: the signal), and a sentence."""

    code: int
    says: str


async def tend(module: str, arguments: Sequence[str], log: Path, hung: Callable[[], str]) -> End:
    """Run a module of this package until it ends, or until `hung` says what it hangs over.

    Its output goes to `log`, begun anew, so that a guest that dies over and over does not fill the disk; what was
    there is kept once, as `.last`. Where this is cancelled, the process is ended first.
    """
    if log.exists():
        log.replace(log.with_suffix(".last"))
    why = ""
    with log.open("wb") as output:
        process = start_child(module, arguments, output, stdout=output, environment=ONE_THREAD)
        try:
            while process.poll() is None and not why:
                await asyncio.sleep(0.1)
                why = hung()
        finally:
            (kill_child if why else end_child)(process)
    return End(process.returncode, why or f"ended with status {process.returncode}: {last_line(log)}")
