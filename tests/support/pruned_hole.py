"""A gap that cannot be filled: a daemon is killed, and its successor's journal lacks the events in between."""

import os
import signal
import socket
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

from pzctl.daemon.client.location import Location
from pzctl.daemon.files.paths import journal_folder
from pzctl.daemon.journal.retention import JournalMaintenance
from pzctl.daemon.wire.events import SampleStep, StateEvent
from pzctl.models.build import Build

PRUNED = 3
"""Number of events in between."""


def endpoints() -> dict[str, str]:
    """Return endpoints that a daemon and its successor can use."""
    with socket.socket() as one, socket.socket() as other:
        for each in (one, other):
            each.bind(("127.0.0.1", 0))
        return {
            name: f"tcp://127.0.0.1:{each.getsockname()[1]}" for name, each in (("events", one), ("requests", other))
        }


def prune_unheard(start_daemon: Callable[..., Location], where: Location, home: Path, build: Build) -> int:
    """Kill the daemon, write and prune events that nobody receives, start another daemon; return the last event."""
    os.kill(where.pid, signal.SIGKILL)
    with suppress(ChildProcessError):  # the process that started it waits for it as well
        os.waitpid(where.pid, 0)
    journal = JournalMaintenance(journal_folder(home))
    measurement, _ = journal.begin_measurement("in between", build, "disk")
    for state in ("queued", "measuring", "measured"):
        journal.append(StateEvent(state=state, measurement=measurement, sample=SampleStep(build.name, "disk")))
    last = journal.last_seq
    journal.prune("2999-01-01", home / "backup")
    journal.close()
    again: dict[str, Any] = {"events": where.events, "requests": where.requests}
    start_daemon(**again)
    return last
