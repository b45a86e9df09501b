"""Running a worker process to its end without blocking the daemon's event loop, and ending it if it hangs."""

import asyncio
import os
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import msgspec

from ...client.client import Client
from ...wire.curve_keys import ClientKey
from ...wire.frames import to_json
from .subprocesses import end_child, kill_child, last_line, start_child

ONE_THREAD: dict[str, str] = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""Environment that limits numerical libraries to one thread, so that parallel fitters do not compete for the cores."""


KEY = "PZCTL_WORKER_KEY"
"""Environment variable with the key of a worker."""


@dataclass(frozen=True)
class ProcessExit:
    """The end of a process: its exit status, and a sentence."""

    code: int | None
    """Negative: the signal that ended it; None: it was killed, but is there still."""
    says: str


def not_run(error: OSError) -> str:
    """Return a sentence about a process that could not be run or logged, because the disk is full for example."""
    return f"its process could not be run: {error.filename or 'the log'}: {error.strerror or error}"


def worker_client(events: str, requests: str) -> Client:
    """Return the client for a worker's process; remove its key from the environment."""
    key = os.environ.pop(KEY, None)
    return Client(events, requests, msgspec.json.decode(key, type=ClientKey) if key else None)


async def run_to_end(
    module: str, arguments: Sequence[str], log: Path, key: ClientKey | None, hung: Callable[[], str]
) -> ProcessExit:
    """Run a module of this package until it ends, or end it when `hung` returns a reason.

    Its output goes to a new file `log`, and the previous one is kept as `.last`, so that a worker that crashes again
    and again does not fill the disk. `key` is its key for the daemon. If cancelled, this coroutine ends the process.
    Raises OSError if the log cannot be written or the process cannot be started.
    """
    if log.exists():
        log.replace(log.with_suffix(".last"))
    why = ""
    environment = ONE_THREAD | ({KEY: to_json(key).decode()} if key else {})
    with log.open("wb") as output:
        process = start_child(module, arguments, output, stdout=output, environment=environment)
        try:
            while process.poll() is None and not why:
                await asyncio.sleep(0.1)
                why = hung()
        finally:
            (kill_child if why else end_child)(process)
    return ProcessExit(process.returncode, why or f"ended with status {process.returncode}: {last_line(log)}")
