"""Supervision of the fitters: each runs in a process of its own and is restarted when it ends."""

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
from .process_runner import not_run, run_to_end
from .visitors import LEASE, Visitors
from .worker_main import GIVEN_UP

QUIET = 1.0
"""Seconds within which a ready fitter is not announced again, so that it cannot fill the journal."""

FIRST_WAIT, LONGEST_WAIT = 0.5, 60.0
"""Seconds until a fitter is restarted: doubled at each end up to the longest; reset after a run longer than that."""


@dataclass(frozen=True)
class WorkerExit:
    """The end of a fitter's process."""

    fitter: str
    code: int | None
    says: str


@dataclass
class Supervisor:
    """The fitters that the daemon keeps running, and those that connected by themselves."""

    home: Path
    events: str
    requests: str
    key: ClientKey | None
    """Key of the fitters for the daemon."""
    limits: Limits
    pending: PendingResults
    """The results that the fitters still owe."""
    changed: Callable[[FitterState, str], None]
    """Called with a fitter's new state and a sentence when it became ready, ended or broken."""
    died: Callable[[WorkerExit], None]
    """Called when a process ended by itself."""
    visitors: Visitors
    """The fitters that connected by themselves, and their owners."""
    states: dict[str, FitterState] = field(default_factory=dict[str, FitterState])
    _told: dict[str, float] = field(default_factory=dict[str, float])

    def ready(self, name: str, version: str) -> None:
        """Record that a fitter said hello; a repeated hello changes nothing."""
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
        """Remove fitters that connected by themselves and have been silent for too long."""
        for name in self.visitors.silent():
            if (state := self.states.pop(name, None)) is not None:
                self.changed(FitterState(name, "ended", state.version), f"silent for {LEASE:g} s")
                self._told.pop(name, None)

    async def keep(self, name: str) -> None:
        """Run a fitter until cancelled, restarting it whenever it ends, or until its exit status says to give up."""
        wait = FIRST_WAIT
        loop = asyncio.get_running_loop()
        while True:
            self.states[name] = FitterState(name, "starting")
            began = loop.time()
            exit_ = await self._live(name)
            if exit_.code == GIVEN_UP:
                self._set(FitterState(name, "broken", None, exit_.says))
                return
            self._set(FitterState(name, "ended", self.states[name].version, exit_.says))
            self.died(exit_)
            wait = FIRST_WAIT if loop.time() - began > LONGEST_WAIT else min(2 * wait, LONGEST_WAIT)
            await asyncio.sleep(wait)

    async def _live(self, name: str) -> WorkerExit:
        """Run the process once; end it if it hangs or if this is cancelled."""
        log_name = "fitter-" + "".join(c if c.isalnum() or c in "-_" else "_" for c in name)
        arguments = [name, "--events", self.events, "--requests", self.requests]
        arguments += ["--memory-MB", str(self.limits.memory_MB)]
        began = time.monotonic()
        module = "pzctl.daemon.server.workers.fitter_worker"
        try:
            path = log_file(self.home, log_name)
            end = await run_to_end(module, arguments, path, self.key, lambda: self._hung(name, began))
        except OSError as error:
            return WorkerExit(name, None, not_run(error))
        return WorkerExit(name, end.code, end.says)

    def _hung(self, name: str, began: float) -> str:
        """Return in words why a fitter counts as hanging, or an empty string."""
        limits = self.limits
        if self.states[name].state == "starting" and time.monotonic() - began > limits.start_seconds:
            return f"did not say hello within {limits.start_seconds:g} s of its start"
        if self.pending.waited(name, began) > limits.seconds:
            return f"gave no answer within {limits.seconds:g} s"
        return ""

    def _set(self, state: FitterState) -> None:
        self.states[state.name] = state
        self.changed(state, state.says)
