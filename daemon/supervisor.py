"""Keeps the fitters: each in a process of its own, started again when it dies, and the daemon goes on without it."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from .children import end_child, last_line, start_child
from .guest import GIVEN_UP
from .paths import log_file
from .requests import FitterState

ONE_THREAD: dict[str, str] = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")
"""So that fitters side by side do not fight over the cores."""

FIRST_WAIT, LONGEST_WAIT = 0.5, 60.0
"""Seconds until a fitter that died is started again; doubled at each death, forgotten after a long life."""


@dataclass(frozen=True)
class Fate:
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
    changed: Callable[[FitterState, str], None]
    """Called with a fitter's new state and a sentence when it became ready, ended or broken."""
    died: Callable[[Fate], None]
    """Called when a process ended by itself."""
    states: dict[str, FitterState] = field(default_factory=dict[str, FitterState])

    def ready(self, name: str, version: str) -> None:
        """Note that a fitter said hello."""
        self._set(FitterState(name, "ready", version))

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

    async def _live(self, name: str) -> Fate:
        """Run the process once; end it where this is cancelled."""
        path = log_file(self.home, "fitter-" + "".join(c if c.isalnum() or c in "-_" else "_" for c in name))
        with path.open("ab") as log:
            arguments = [name, "--events", self.events, "--requests", self.requests, "--with-parent"]
            process = start_child("pzctl.daemon.guest", arguments, log, stdout=log, environment=ONE_THREAD)
            try:
                while process.poll() is None:
                    await asyncio.sleep(0.1)
            finally:
                end_child(process)
        return Fate(name, process.returncode, f"ended with status {process.returncode}: {last_line(path)}")

    def _set(self, state: FitterState) -> None:
        self.states[state.name] = state
        self.changed(state, state.says)
