"""A consistent copy of a journal's database, and whether it continues an earlier one."""

import shutil
import sqlite3
from collections.abc import Generator
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ..store import JournalError
from ..stores.chain import head_of
from ..stores.database_file import DATABASE, SEALS, database_fault

STAGE = "backup-stage"
"""Folder in the data folder for the database while it is copied; remains of a killed backup are removed."""


@dataclass(frozen=True)
class Snapshot:
    """A journal's database at one moment, in a separate folder; the arrays are not copied."""

    folder: Path
    events: int
    arrays: tuple[str, ...]
    """Ids of the events with an array."""

    @property
    def database(self) -> Path:
        """The copied database, in one file."""
        return self.folder / DATABASE

    def check_continues(self, earlier: Path, where: str) -> None:
        """Raise JournalError unless this journal's chain continues that of the earlier database, or is the same."""
        try:
            with closing(_reading(earlier)) as before, closing(_reading(self.database)) as now:
                old, new = _Rows(before), _Rows(now)
                for (station,) in old.all("SELECT DISTINCT station FROM chain"):
                    number, link = head_of(old, station)
                    if new.all("SELECT link FROM chain WHERE station = ? AND number = ?", station, number) != [(link,)]:
                        raise JournalError(
                            f"{where}: this journal does not continue the one in the backup, so it was repaired, "
                            "restored or begun anew; nothing was changed there: name another folder, or move that "
                            "one away"
                        )
        except sqlite3.Error as error:
            raise JournalError(f"{where}: the database in the backup cannot be read: {error}") from None


@contextmanager
def snapshot(journal: Path) -> Generator[Snapshot]:
    """Copy the database and the seals of a journal, even while a daemon writes it. Raises JournalError."""
    fault = database_fault(journal)
    if fault is not None:
        raise JournalError(f"{journal}: {DATABASE} {fault}")
    folder = journal.parent / STAGE
    try:
        if folder.exists():
            shutil.rmtree(folder)
        folder.mkdir(mode=0o700)
        with closing(_reading(journal / DATABASE)) as db, closing(sqlite3.connect(folder / DATABASE)) as copy:
            db.backup(copy)
            copy.execute("PRAGMA journal_mode=DELETE")  # one file, without a write-ahead log beside it
            arrays = tuple(name for (name,) in copy.execute("SELECT id FROM events WHERE hash IS NOT NULL ORDER BY id"))
            ((events,),) = copy.execute("SELECT count(*) FROM events").fetchall()
        if (journal / SEALS).exists():
            shutil.copy(journal / SEALS, folder / SEALS)
        yield Snapshot(folder, events, arrays)
    except sqlite3.Error as error:
        raise JournalError(f"{journal}: the journal cannot be read: {error}") from None
    except OSError as error:
        raise JournalError(f"{error.filename or folder}: {error.strerror or error}") from None
    finally:
        shutil.rmtree(folder, ignore_errors=True)


class _Rows:
    """A database, as `Statements` for the chain."""

    def __init__(self, db: sqlite3.Connection) -> None:
        self._db = db

    def all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        return self._db.execute(sql, values).fetchall()

    def run(self, sql: str, *values: object) -> None:
        self._db.execute(sql, values)


def _reading(path: Path) -> sqlite3.Connection:
    return sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True)
