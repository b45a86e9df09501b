"""Runs one guest process to its end, and ends it where it hangs; the daemon's loop goes on meanwhile."""

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
"""So that fitters side by side do not fight over the cores."""


KEY = "PZCTL_GUEST_KEY"
"""Of the environment: the key that a guest comes in with."""


@dataclass(frozen=True)
class ProcessExit:
    """How a process ended: its exit status (negative: the signal), and a sentence."""

    code: int
    says: str


def guest_client(events: str, requests: str) -> Client:
    """Return the client that a guest's process talks through; its key is taken out of the environment."""
    key = os.environ.pop(KEY, None)
    return Client(events, requests, msgspec.json.decode(key, type=ClientKey) if key else None)


async def run_to_end(
    module: str, arguments: Sequence[str], log: Path, key: ClientKey | None, hung: Callable[[], str]
) -> ProcessExit:
    """Run a module of this package until it ends, or until `hung` says what it hangs over.

    Its output goes to `log`, begun anew, so that a guest that dies over and over does not fill the disk; what was
    there is kept once, as `.last`. `key` lets it in where the daemon
    asks for one. Where this is cancelled, the process is ended first.
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
