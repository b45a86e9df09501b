"""`pzctl journal`: check, copy, repair and prune the record of everything that was measured."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

app = typer.Typer(no_args_is_help=True, help="Check, copy, repair and prune the journal.")


@app.command("verify")
def verify(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Compare every recording with its hash, and look for gaps. Needs no daemon, and disturbs none.

    Exit status: 0 all is whole, 1 something is wrong.

    Example: pzctl journal verify
    """
    from ...samples.sample_selection import open_journal

    journal = open_journal()
    try:
        wrong = journal.verify()
        arrays = len(journal.with_arrays())
        if as_json:
            print(json.dumps({"events": journal.size, "arrays": arrays, "wrong": wrong}))
        else:
            print("\n".join(wrong) if wrong else f"{journal.size} events, {arrays} arrays: all whole")
    finally:
        journal.close()
    if wrong:
        sys.exit(1)


@app.command("backup")
def backup(
    target: Annotated[str, typer.Argument(help="A new folder, or the URL of a PostgreSQL database.")],
    station: Annotated[str | None, typer.Option(help="What a folder's journal is called in a database.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Copy the journal and verify the copy; a daemon may go on measuring meanwhile.

    The copy is a journal: `PZCTL_HOME` may name the folder above one that is called `journal`.

    Examples: pzctl journal backup /mnt/archive/2026-11/journal

    pzctl journal backup postgresql://pzctl@lab-server/pzctl --station bench1
    """
    from ...files.config import journal_of
    from ...journal.retention import copy_journal
    from ...journal.store import without_password
    from ...samples.sample_selection import open_journal

    to_url = target.startswith(("postgresql://", "postgres://"))
    named = {"station": station} if station else {}
    called = journal_of({"journal": target} | named)[1] if to_url else ""
    journal = open_journal()
    try:
        copied = copy_journal(journal, target if to_url else Path(target), called)
        where = without_password(target)
        told = {"events": copied, "target": where}
        print(json.dumps(told) if as_json else f"{copied} events copied to {where} and verified")
    finally:
        journal.close()


@app.command("repair")
def repair(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Rebuild a lost or damaged database from the recordings beside it. No daemon may run meanwhile.

    Measurements, builds and sweeps come back; what fitters answered does not: fit them again. Nothing is removed.

    Example: pzctl journal repair
    """
    from ...files.paths import home, journal_folder
    from ...journal.repair import repair as repaired

    done = repaired(journal_folder(home()))
    silent = [str(path) for path in done.silent]
    if as_json:
        print(json.dumps({"recordings": done.recordings, "silent": silent, "aside": done.aside and str(done.aside)}))
        return
    if done.aside:
        print(f"the damaged database is kept as {done.aside}")
    print(f"{done.recordings} recordings put back")
    if silent:
        print(f"{len(silent)} files do not say what they are, and stay where they are: {', '.join(silent[:5])}")


@app.command("prune")
def prune(
    before: Annotated[str, typer.Option(help="Measurements before this day go: 2026-01-01 (UTC).")],
    backup_to: Annotated[Path, typer.Option("--backup", help="A new folder that all of it is copied to first.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Copy the journal, then remove its oldest measurements. No daemon may run meanwhile.

    Example: pzctl journal prune --before 2026-01-01 --backup /mnt/archive/until-2026/journal
    """
    from datetime import date

    from ...files.config import journal_of, settings
    from ...files.paths import home, journal_folder
    from ...journal.retention import JournalMaintenance
    from ..analysis.fit import UsageError

    try:
        day = date.fromisoformat(before)
    except ValueError:
        raise UsageError(f"--before {before}: a day is needed, such as 2026-01-01") from None
    keeper = JournalMaintenance(journal_folder(home()), *journal_of(settings({})))
    try:
        removed = keeper.prune(day.isoformat(), backup_to)
        told = {"removed": removed, "backup": str(backup_to)}
        print(json.dumps(told) if as_json else f"events removed: {removed}; all that was is in {backup_to}")
    finally:
        keeper.close()
