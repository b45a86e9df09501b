"""Keeps the fitters: each in a process of its own, started again when it dies, and the daemon goes on without it."""

import asyncio
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from ...files.paths import log_file
from ...files.worker_limits import Limits
from ...wire.curve_keys import ClientKey
from ...wire.replies import FitterState
from .pending_results import PendingResults
from .process_runner import run_to_end
from .visitors import LEASE, Visitors
from .worker_main import GIVEN_UP

QUIET = 1.0
"""Seconds within which a fitter that is ready is not announced again: it must not fill the journal."""

FIRST_WAIT, LONGEST_WAIT = 0.5, 60.0
"""Seconds until a fitter that died is started again; doubled at each death, forgotten after a long life."""


@dataclass(frozen=True)
class WorkerExit:
    """What became of a fitter's process."""

    fitter: str
    code: int
    says: str


@dataclass
class Supervisor:
    """The fitters a daemon was told to keep, and those that came by themselves."""

    home: Path
    events: str
    requests: str
    key: ClientKey | None
    """What lets a fitter in, where keys are asked for."""
    limits: Limits
    ledger: PendingResults
    """Who owes which answer since when."""
    changed: Callable[[FitterState, str], None]
    """Called with a fitter's new state and a sentence when it became ready, ended or broken."""
    died: Callable[[WorkerExit], None]
    """Called when a process ended by itself."""
    visitors: Visitors
    """Whose those are that came by themselves."""
    states: dict[str, FitterState] = field(default_factory=dict[str, FitterState])
    _told: dict[str, float] = field(default_factory=dict[str, float])

    def ready(self, name: str, version: str) -> None:
        """Note that a fitter said hello; said again, it is no news."""
        state = FitterState(name, "ready", version)
        known = self.states.get(name)
        if known == state:
            return
        if known is not None and known.state == "ready" and time.monotonic() - self._told.get(name, -QUIET) < QUIET:
            self.states[name] = state
            return
        self._told[name] = time.monotonic()
        self._set(state)

    def forget_silent(self) -> None:
        """Take those off the list that came by themselves and have not been heard of for too long."""
        for name in self.visitors.silent():
            if (state := self.states.pop(name, None)) is not None:
                self.changed(FitterState(name, "ended", state.version), f"not heard of for {LEASE:g} s")
                self._told.pop(name, None)

    async def keep(self, name: str) -> None:
        """Run a fitter for ever, or until it says that starting it again is of no use."""
        wait = FIRST_WAIT
        loop = asyncio.get_running_loop()
        while True:
            self.states[name] = FitterState(name, "starting")
            began = loop.time()
            fate = await self._live(name)
            if fate.code == GIVEN_UP:
                self._set(FitterState(name, "broken", None, fate.says))
                return
            self._set(FitterState(name, "ended", self.states[name].version, fate.says))
            self.died(fate)
            wait = FIRST_WAIT if loop.time() - began > LONGEST_WAIT else min(2 * wait, LONGEST_WAIT)
            await asyncio.sleep(wait)

    async def _live(self, name: str) -> WorkerExit:
        """Run the process once; end it where it hangs, or where this is cancelled."""
        path = log_file(self.home, "fitter-" + "".join(c if c.isalnum() or c in "-_" else "_" for c in name))
        arguments = [name, "--events", self.events, "--requests", self.requests]
        arguments += ["--memory-MB", str(self.limits.memory_MB)]
        began = time.monotonic()
        end = await run_to_end(
            "pzctl.daemon.server.workers.fitter_worker", arguments, path, self.key, lambda: self._hung(name, began)
        )
        return WorkerExit(name, end.code, end.says)

    def _hung(self, name: str, began: float) -> str:
        """Return what a fitter hangs over, in words; nothing where it does not."""
        most = self.limits
        if self.states[name].state == "starting" and time.monotonic() - began > most.start_seconds:
            return f"did not say hello within {most.start_seconds:g} s of its start"
        if self.ledger.waited(name, began) > most.seconds:
            return f"gave no answer within {most.seconds:g} s"
        return ""

    def _set(self, state: FitterState) -> None:
        self.states[state.name] = state
        self.changed(state, state.says)
