"""The scheduled backup: a separate process at the planned times, whose result is stored, published and shown."""

import asyncio
import logging
import os
import signal
import sys
from collections.abc import Callable
from datetime import UTC, datetime, timedelta
from pathlib import Path

import msgspec

from ....models.sweep import now_utc
from ...files.backup_plan import BackupPlan
from ...files.paths import backup_file, journal_folder, log_file
from ...wire.events import StateEvent
from ...wire.frames import WireError, from_json, to_json
from ...wire.replies import BackupState
from .subprocesses import last_line, start_child

log = logging.getLogger(__name__)

LOOK = 0.5
"""Seconds between two checks whether a backup is due or done."""

RETRY = timedelta(hours=1)
"""Longest time until a failed backup is tried again."""

LATE = 2
"""Number of intervals without success after which a backup is late."""


class BackupSchedule:
    """Makes backups as planned for as long as `keep` runs; never blocks the event loop, even if a share hangs."""

    def __init__(self, plan: BackupPlan | None, folder: Path, publish: Callable[[StateEvent], object]) -> None:
        self._plan = plan
        self._folder = folder
        self._publish = publish
        self._began = datetime.now(UTC)
        self._known = BackupState("", 0.0) if plan is None else _remembered(folder, plan)

    @property
    def state(self) -> BackupState | None:
        """The last backups, or None if none is planned."""
        if self._plan is None:
            return None
        since = _time(self._known.last_success) or self._began
        late = datetime.now(UTC) - since > LATE * timedelta(hours=self._plan.every_hours)
        return msgspec.structs.replace(self._known, late=late)

    async def keep(self) -> None:
        """Back up whenever it is due, until cancelled."""
        if self._plan is None:
            return
        while True:
            if self._is_due(self._plan):
                await self._back_up(self._plan)
            await asyncio.sleep(LOOK)

    def _is_due(self, plan: BackupPlan) -> bool:
        known = self._known
        last = _time(known.last_failure if known.failed else known.last_success)
        if last is None:
            return True
        wait = timedelta(hours=plan.every_hours)
        if known.failed:
            wait = min(wait, RETRY)
        return not timedelta(0) <= datetime.now(UTC) - last < wait  # a clock set back does not delay it

    async def _back_up(self, plan: BackupPlan) -> None:
        self._known = msgspec.structs.replace(self._known, running=True)
        try:
            done, says = await self._run(plan)
        except OSError as error:  # no log or no process: a failure of the backup, not of the daemon
            done, says = False, f"{error.filename or 'backup'}: {error.strerror or error}"
        self._ended(done, says)

    async def _run(self, plan: BackupPlan) -> tuple[bool, str]:
        """Run the process; return whether it succeeded, and its last line."""
        output = log_file(self._folder, "backup")
        again = ["--again"] if self._known.last_success else []
        arguments = [str(journal_folder(self._folder)), plan.to, *again]
        with output.open("wb") as file:
            process = start_child(
                "pzctl.daemon.server.workers.backup_worker", arguments, file, stdout=file, environment={}
            )
        try:
            while process.poll() is None:
                await asyncio.sleep(LOOK)
        finally:
            if process.poll() is None:  # do not wait: a process that waits for a dead share cannot be ended
                if sys.platform == "win32":
                    process.kill()
                else:
                    os.killpg(process.pid, signal.SIGKILL)
            if process.stdin is not None:
                process.stdin.close()
        return process.returncode == 0, last_line(output)

    def _ended(self, done: bool, says: str) -> None:
        now = now_utc()
        changes = {"last_success": now} if done else {"last_failure": now}
        self._known = msgspec.structs.replace(self._known, running=False, failed=not done, says=says, **changes)
        if not done:
            log.error("backup to %s: %s", self._known.to, says)
        _remember(self._folder, self._known)
        self._publish(StateEvent(state="backup-done" if done else "backup-failed", says=f"to {self._known.to}: {says}"))


def _remembered(folder: Path, plan: BackupPlan) -> BackupState:
    """Return the state stored by the previous daemon, if the target is the same."""
    fresh = BackupState(plan.to, plan.every_hours)
    try:
        kept = from_json(backup_file(folder).read_bytes(), _decoder)
    except (OSError, WireError):
        return fresh
    return msgspec.structs.replace(kept, every_hours=plan.every_hours, running=False) if kept.to == plan.to else fresh


def _remember(folder: Path, state: BackupState) -> None:
    part = backup_file(folder).with_suffix(".part")
    try:
        part.write_bytes(to_json(state))
        part.replace(backup_file(folder))
    except OSError as error:
        log.warning("%s cannot be written: %s", backup_file(folder), error.strerror)


def _time(text: str | None) -> datetime | None:
    try:
        return datetime.fromisoformat(text) if text else None
    except ValueError:
        return None


_decoder = msgspec.json.Decoder(BackupState)
