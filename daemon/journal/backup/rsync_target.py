"""Backup to another machine by rsync over ssh, where rsync is installed; read back by comparing checksums there."""

import subprocess
from contextlib import closing
from pathlib import Path

from ..journal_reader import JournalReader
from ..store import JournalError
from ..stores.array_folder import ARRAYS
from ..stores.database_file import DATABASE
from .snapshot import Snapshot

OPTIONS = ("--timeout=120", "--protect-args", "-e", "ssh -o BatchMode=yes -o ConnectTimeout=20")
"""No questions at a terminal; dead connections time out; no remote shell interprets the name of the folder."""

_CODE_PARTIAL = 23
"""rsync's exit status if a file could not be transferred."""


def back_up_by_rsync(source: Path, taken: Snapshot, target: str, *, again: bool) -> None:
    """Bring the journal in `TARGET/journal` up to date, and compare checksums of all its files. Raises JournalError.

    `again`: there was a backup before, so one must exist. The previous database is kept as `journal.sqlite.previous`.
    """
    with closing(JournalReader(source)) as journal:
        if faults := journal.verify():
            raise JournalError(f"{source}: the journal is damaged, so it is not copied: {faults[0]}")
    there = f"{target.rstrip('/')}/journal"
    earlier = taken.folder / "earlier"
    _run("--list-only", "--", f"{target.rstrip('/')}/")
    fetched = _rsync("--", f"{there}/{DATABASE}", str(earlier))
    if fetched.returncode == 0:
        taken.check_continues(earlier, there)
        earlier.unlink()
    elif again or fetched.returncode != _CODE_PARTIAL or "No such file" not in fetched.stderr:
        raise _fault(target, fetched)
    listed = taken.folder / "files"
    listed.write_text("".join(f"{ARRAYS}/{event}.bin\n" for event in taken.arrays), encoding="utf-8")
    arrays = ("-a", f"--files-from={listed}", "--", f"{source}/", f"{there}/")
    rows = ("-a", "--include=journal.sqlite", "--include=seals.jsonl", "--exclude=*", "--", f"{taken.folder}/", there)
    _run(*arrays)
    # two databases of the same second may have the same size
    _run("--ignore-times", "--backup", "--suffix=.previous", *rows)
    for compared in (arrays, rows):
        said = _run("--dry-run", "--checksum", "--itemize-changes", *compared)
        differs = [line for line in said.splitlines() if line[:1] in "<>c"]
        if differs:
            raise JournalError(f"{there}: the copy differs from the journal: {differs[0].split(maxsplit=1)[-1]}")


def _run(*words: str) -> str:
    ended = _rsync(*words)
    if ended.returncode != 0:
        raise _fault(words[-1], ended)
    return ended.stdout


def _rsync(*words: str) -> "subprocess.CompletedProcess[str]":
    try:
        return subprocess.run(  # noqa: S603
            ["rsync", *OPTIONS, *words],  # noqa: S607
            capture_output=True,
            text=True,
            errors="replace",
            check=False,
            stdin=subprocess.DEVNULL,
        )
    except FileNotFoundError:
        raise JournalError("a backup to another machine needs rsync, which is not installed here") from None


def _fault(target: str, ended: "subprocess.CompletedProcess[str]") -> JournalError:
    lines = [line.strip() for line in ended.stderr.splitlines() if line.strip()]
    return JournalError(f"{target}: rsync ended with status {ended.returncode}: {lines[0] if lines else 'no output'}")
