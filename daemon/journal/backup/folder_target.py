"""Backup into a folder, such as a mounted share: copies missing arrays and the database, then reads all back."""

from contextlib import closing
from pathlib import Path

from ..journal_reader import JournalReader
from ..store import JournalError
from ..stores.array_folder import ArrayFolder, copy_file, sync_folder
from ..stores.database_file import DATABASE, SEALS
from ..stores.folder_lock import is_written
from .snapshot import Snapshot

PREVIOUS = f"{DATABASE}.previous"
"""The database of the previous backup, kept beside the new one."""


def back_up_to_folder(source: Path, taken: Snapshot, target: Path, *, again: bool) -> None:
    """Bring the journal in `target/journal` up to date, and read all of it back. Raises JournalError, OSError.

    `again`: there was a backup before, so one must exist; otherwise an unmounted share's folder might be filled.
    The database there is replaced only by one that continues it, and restored if the new copy is damaged.
    """
    journal = target / "journal"
    database = journal / DATABASE
    _check_target(target, journal, again=again)
    if database.exists():
        taken.check_continues(database, str(journal))
    files = ArrayFolder(journal)
    files.make()
    _copy_arrays(ArrayFolder(source), files, taken.arrays)
    for name in (DATABASE, SEALS):
        if (taken.folder / name).exists():
            part = journal / f"{name}.part"
            part.unlink(missing_ok=True)
            copy_file(taken.folder / name, part)
    if database.exists():
        database.replace(journal / PREVIOUS)
    for name in (DATABASE, SEALS):
        if (part := journal / f"{name}.part").exists():
            part.replace(journal / name)
    sync_folder(journal)
    _read_back(journal)


def _check_target(target: Path, journal: Path, *, again: bool) -> None:
    """Raise JournalError if the share is not mounted, or if its journal is a different one."""
    if not target.is_dir():
        raise JournalError(f"{target}: this folder does not exist; is the share mounted?")
    if again and not (journal / DATABASE).exists():
        raise JournalError(f"{target}: the earlier backup is not there; is the share mounted?")
    if journal.is_symlink():
        raise JournalError(f"{journal}: this is a symbolic link, which a backup does not follow")
    log = journal / f"{DATABASE}-wal"
    if journal.exists() and (is_written(journal) or (log.exists() and log.stat().st_size)):
        raise JournalError(f"{journal}: a daemon uses this backup as its journal; restore into another folder")


def _copy_arrays(source: ArrayFolder, target: ArrayFolder, events: tuple[str, ...]) -> None:
    """Copy the arrays that are missing or incomplete in the target."""
    for event in events:
        here, there = source.path(event), target.path(event)
        if here.is_symlink() or not here.exists():
            raise JournalError(f"{here}: this recording is missing; run `pzctl journal verify`")
        if there.exists() and there.stat().st_size == here.stat().st_size:
            continue
        part = there.with_suffix(".part")
        part.unlink(missing_ok=True)
        copy_file(here, part)
        part.replace(there)
    sync_folder(target.arrays)


def _read_back(journal: Path) -> None:
    """Raise JournalError if the copy is damaged, after restoring the previous database."""
    with closing(JournalReader(journal)) as copy:
        faults = copy.verify()
    if not faults:
        return
    previous = journal / PREVIOUS
    if previous.exists():
        previous.replace(journal / DATABASE)
    raise JournalError(
        f"{journal}: the copy is damaged: {faults[0]}; move that file away, and the next backup copies it again"
    )
