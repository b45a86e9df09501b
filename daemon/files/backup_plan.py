"""The scheduled backup: where to, and how often; the table `[backup]` of the config file."""

import re
from collections.abc import Mapping
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

_REMOTE = re.compile(r"(?:[\w.][\w.-]*@)?(?:[\w.][\w.-]*|\[[0-9A-Fa-f:]+\]):[^:\s].*", re.ASCII)
"""`USER@HOST:FOLDER`; neither can begin with `-`, which rsync and ssh would read as an option."""

_SHORTEST_HOURS = 0.001
"""A backup may begin every few seconds, not without a pause."""


@dataclass(frozen=True)
class BackupPlan:
    """Where the daemon copies its journal to, and how often."""

    to: str
    """An existing folder on another disk, such as a mounted share, or `USER@HOST:FOLDER`, by rsync over ssh."""
    every_hours: float = 24.0

    @property
    def is_remote(self) -> bool:
        """Whether the target is on another machine."""
        return not Path(self.to).is_absolute()


def read_backup(table: Any) -> BackupPlan:
    """Return the plan in a table of the config file, or in the text of its target. Raises ValueError, TypeError."""
    if isinstance(table, str):
        table = {"to": table}
    if not isinstance(table, Mapping) or not {*table} <= {field.name for field in fields(BackupPlan)}:  # pyright: ignore[reportUnknownArgumentType]
        raise ValueError
    plan = BackupPlan(**table)  # pyright: ignore[reportUnknownArgumentType]
    if isinstance(plan.every_hours, bool) or not _SHORTEST_HOURS <= plan.every_hours < float("inf"):
        raise ValueError
    if not plan.to.isprintable() or (plan.is_remote and not _REMOTE.fullmatch(plan.to)):
        raise ValueError
    return plan
