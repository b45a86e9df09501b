"""Copying a journal, and removing its oldest part once it has been copied."""

import os
import shutil
from pathlib import Path

from ..models.sweep import now_utc
from .archive import Archive, JournalError, told
from .journal import Journal
from .migrations import copy_database


class Keeper(Journal):
    """A journal opened to be copied and pruned; no daemon may write it meanwhile."""

    def prune(self, before: str, backup: Path) -> int:
        """Copy the journal to the folder `backup`, then remove what is older; return how many events that was.

        `before` is RFC 3339, UTC, or the beginning of it, such as `2026-01-01`. Measurements go whole: from the
        oldest one that stays, everything stays. Raises JournalError; then nothing was removed.
        """
        copy_journal(self, backup)
        stays = self._one("SELECT min(number) FROM measurements WHERE time >= ?", before)
        number = stays[0] if stays and stays[0] is not None else self._after_last()
        old = "(SELECT id FROM measurements WHERE number < ?)"
        last = self._one(
            "SELECT coalesce(min(seq) - 1, (SELECT max(seq) FROM events)) FROM events WHERE measurement IN "
            "(SELECT id FROM measurements WHERE number >= ?)",
            number,
        )
        seq = int(last[0] or 0) if last else 0
        gone = self._all("SELECT id, hash FROM events WHERE seq <= ?", seq)
        if not gone:
            return 0
        with told(self.folder), self._transaction():
            self._db.execute("DELETE FROM fits WHERE seq <= ?", (seq,))
            self._db.execute("DELETE FROM events WHERE seq <= ?", (seq,))
            self._db.execute(
                f"DELETE FROM measurements WHERE number < ? AND id NOT IN "  # noqa: S608
                f"(SELECT measurement FROM events WHERE measurement IN {old})",
                (number, number),
            )
            self._db.execute("DELETE FROM builds WHERE hash NOT IN (SELECT build FROM measurements)")
            self._db.execute("INSERT INTO prunings VALUES (?, ?, ?)", (seq, now_utc(), str(backup)))
        for event, digest in gone:  # what a kill leaves here is removed at the next start
            if digest:
                (self.arrays / f"{event}.bin").unlink(missing_ok=True)
        return len(gone)

    def _after_last(self) -> int:
        row = self._one("SELECT coalesce(max(number), 0) + 1 FROM measurements")
        return int(row[0]) if row else 1


def copy_journal(source: Archive, target: Path) -> int:
    """Copy a journal to a new folder, while a daemon may go on writing it, and verify the copy.

    Returns the number of events in it. Raises JournalError where the folder is not empty, or the copy not whole.
    """
    if target.exists() and any(target.iterdir()):
        raise JournalError(f"{target}: this folder is not empty; a journal is copied to a new one")
    with told(target):
        (target / "arrays").mkdir(parents=True, exist_ok=True, mode=0o700)
        copy_database(source.database, target / "journal.sqlite")
    copy = Archive(target)
    try:
        for event in copy.with_arrays():
            with told(target):
                _copy_file(source.arrays / f"{event}.bin", copy.arrays / f"{event}.bin")
        wrong = copy.verify()
        if wrong:
            raise JournalError(f"{target}: the copy is not whole: {wrong[0]}")
        return copy.size
    finally:
        copy.close()


def _copy_file(source: Path, target: Path) -> None:
    """Copy a file that is never written again: by a second name where both are on one disk."""
    try:
        os.link(source, target)
    except OSError:
        shutil.copyfile(source, target)
