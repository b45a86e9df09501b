"""`pzctl journal`: check, seal, audit, copy, repair and prune the record of everything that was measured."""

import json
import sys
from pathlib import Path
from typing import Annotated

import typer

from ....models.base.names import check_name, shown

app = typer.Typer(no_args_is_help=True, help="Check, seal, audit, copy, repair and prune the journal.")


@app.command("verify")
def verify(
    public_key: Annotated[
        Path | None, typer.Option(help="Public key of the seals; default: the data folder's.")
    ] = None,
    seals: Annotated[Path | None, typer.Option(help="Another file of seals, kept elsewhere.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Check the database, the hash chain of all rows, every recording, and the seals.

    It needs no daemon and does not disturb a running one.

    Exit status: 0 everything is intact, 1 something is wrong.

    Example: pzctl journal verify
    """
    from ...files.paths import home, journal_folder, seal_key
    from ...journal.integrity.seals import read_public_key, read_seals, seal_faults
    from ...journal.stores.database_file import SEALS
    from ...samples.sample_selection import open_journal

    trusted = public_key or seal_key(home())[1]
    journal = open_journal()
    try:
        wrong = journal.verify()
        sealed = [*read_seals(journal_folder(home()) / SEALS), *(read_seals(seals) if seals else [])]
        known = read_public_key(trusted) if public_key or trusted.exists() else None
        wrong += seal_faults(journal.store, sealed, known)
        arrays = len(journal.with_arrays())
        if as_json:
            answer = {"events": journal.size, "arrays": arrays, "wrong": wrong, "seals": len(sealed)}
            print(json.dumps(answer))
        elif wrong:
            print(shown("\n".join(wrong), keep="\n"))
        else:
            print(f"{journal.size} events, {arrays} arrays: all intact")
            if sealed:
                print(f"sealed up to entry {max(seal.number for seal in sealed)} of the chain; seals: {len(sealed)}")
    finally:
        journal.close()
    if wrong:
        sys.exit(1)


@app.command("seal")
def seal(
    key: Annotated[Path | None, typer.Option(help="A private Ed25519 key (PEM); default: the data folder's.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Verify the journal and sign its contents, so that nobody without the key can rewrite it unnoticed.

    The first seal makes the key. Keep a copy of the printed seal and of the public key on another machine.

    Examples: pzctl journal seal

    pzctl journal seal --key /media/stick/private.pem
    """
    from ...files.paths import home, journal_folder, seal_key
    from ...journal.integrity.seals import add_seal, keep_public_key, make_key, seal_head
    from ...journal.store import JournalError
    from ...journal.stores.chain import head_of
    from ...journal.stores.database_file import SEALS
    from ...samples.sample_selection import open_journal
    from ...wire.frames import to_json

    private, public = seal_key(home())
    journal = open_journal()
    try:
        head = head_of(journal.store, journal.station)  # before verifying: later rows are neither verified nor sealed
        wrong = journal.verify()
        if wrong:
            raise JournalError(f"{journal.name}: not sealed, because the journal is damaged: {wrong[0]}")
        if key is None:
            make_key(private)
        keep_public_key(key or private, public)
        new_seal = seal_head(head, journal.station, key or private)
        path = journal_folder(home()) / SEALS
        add_seal(path, new_seal)
        print(
            to_json(new_seal).decode() if as_json else f"sealed up to entry {new_seal.number} of the chain, in {path}"
        )
    finally:
        journal.close()


@app.command("audit")
def audit(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """List who did what: measurements, cancels, bench commands, leases, starts of the daemon. Needs no daemon.

    Each entry is an event of the journal, so `pzctl journal verify` reveals a changed or removed one.

    Example: pzctl journal audit
    """
    import msgspec

    from ...journal.integrity.audit import audit_entries
    from ...samples.sample_selection import open_journal

    journal = open_journal()
    try:
        entries = list(audit_entries(journal.store))
    finally:
        journal.close()
    if as_json:
        print(json.dumps({"audit": msgspec.to_builtins(entries)}))
        return
    from ...report.tables.audit_table import print_audit
    from ...report.terminal import console

    print_audit(console(), entries)


@app.command("withdraw")
def withdraw(
    measurement: Annotated[str, typer.Argument(help="Id of a complete measurement; see `pzctl samples --json`.")],
    by: Annotated[str, typer.Option(help="Name of the person who withdraws it.")],
    why: Annotated[str, typer.Option(help="The reason, in one sentence.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Mark a measurement as withdrawn: it stays in the journal, but fits and populations leave it out by default.

    Example: pzctl journal withdraw 0197d2b0-77a1-7d2f-8f5a-1c0e --by Ana --why "the lead had come off"
    """
    from ...client.location import find
    from ...files.paths import home
    from ...wire.request_names import LONGEST_OWNER
    from ...wire.requests import LONGEST_REASON

    who, reason = check_name(by.strip(), "--by", LONGEST_OWNER), check_name(why.strip(), "--why", LONGEST_REASON)
    if find(home()) is not None:
        _ask_to_withdraw(measurement, who, reason)
    else:
        _withdraw_here(measurement, who, reason)
    answer = {"measurement": measurement, "by": who, "why": reason}
    print(json.dumps(answer) if as_json else f"{measurement} is withdrawn, by {who}: {reason}")


def _ask_to_withdraw(measurement: str, by: str, why: str) -> None:
    """Ask the running daemon, which writes the journal, to withdraw the measurement."""
    from ...client.client import connect
    from ...wire.replies import Answer
    from ...wire.requests import WithdrawRequest
    from ...wire.uuid7 import uuid7

    with connect() as lab:
        request = WithdrawRequest(id=uuid7(), measurement=measurement, why=why, by=by)
        lab.run(lab.conversations.answer_to(request, Answer))


def _withdraw_here(measurement: str, by: str, why: str) -> None:
    """Write the withdrawal to the journal; no daemon is running."""
    from ...files.config import journal_of, settings
    from ...files.paths import home, journal_folder
    from ...journal.journal_writer import JournalWriter
    from ...journal.withdrawal import withdrawal_event
    from ...samples.sample_selection import open_journal
    from ...wire.curve_keys import LOCAL

    open_journal().close()  # fails if nothing was measured yet, so that no empty journal is made
    journal = JournalWriter(journal_folder(home()), *journal_of(settings({})))
    try:
        journal.append(withdrawal_event(journal, measurement, why, LOCAL, by))
    finally:
        journal.close()


@app.command("repair")
def repair(
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Rebuild a lost or damaged database from the metadata in the recordings. No daemon may run meanwhile.

    Withdrawals and the audit log are taken from the old database, as far as it can be read; what is lost is listed.
    The old database is kept beside the new one; recordings without metadata are moved to `orphans/`.

    Example: pzctl journal repair
    """
    from ...files.config import journal_of, settings
    from ...files.database_url import without_password
    from ...files.paths import home, journal_folder
    from ...journal.integrity.repair import repair_folder
    from ...journal.store import JournalError

    url, _ = journal_of(settings({}))
    if url is not None:
        raise JournalError(
            f"{without_password(url)}: a PostgreSQL database keeps recordings and rows together, so there is "
            "nothing to repair it from; restore it with the server's own tools, or from a `pzctl journal backup`"
        )
    report = repair_folder(journal_folder(home()))
    if as_json:
        kept = str(report.kept_database) if report.kept_database else None
        answer = {"events": report.events, "measurements": report.measurements, "kept": kept}
        answer |= {"salvaged": report.salvaged, "set_aside": report.set_aside, "lost": report.lost}
        print(json.dumps(answer))
        return
    print(f"{report.measurements} measurements were restored: {report.events} events from the recordings")
    print(f"{report.salvaged} events without a recording, such as withdrawals, were taken from the old database")
    for sentence in report.lost:
        print(shown(f"lost: {sentence}"))
    if report.kept_database:
        print(f"the old database is kept as {report.kept_database}")
    for sentence in report.set_aside:
        print(shown(f"moved to orphans/: {sentence}"))


@app.command("backup")
def backup(
    target: Annotated[str, typer.Argument(help="A new folder, or the URL of a PostgreSQL database.")],
    station: Annotated[str | None, typer.Option(help="Name of this bench in a database.")] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print one JSON object and nothing else.")] = False,
) -> None:
    """Copy the journal and verify the copy; a running daemon may go on measuring.

    The copy is a complete journal: if its folder is called `journal`, `PZCTL_HOME` may name the folder above it.

    Examples: pzctl journal backup /mnt/archive/2026-11/journal

    pzctl journal backup postgresql://pzctl@lab-server/pzctl --station bench1
    """
    from ...files.config import journal_of
    from ...files.database_url import without_password
    from ...journal.retention import copy_journal
    from ...samples.sample_selection import open_journal

    to_url = target.startswith(("postgresql://", "postgres://"))
    named = {"station": station} if station else {}
    station_name = journal_of({"journal": target} | named)[1] if to_url else ""
    journal = open_journal()
    try:
        copied = copy_journal(journal, target if to_url else Path(target), station_name)
        where = without_password(target)
        answer = {"events": copied, "target": where}
        print(json.dumps(answer) if as_json else f"{copied} events copied to {where} and verified")
    finally:
        journal.close()


@app.command("prune")
def prune(
    before: Annotated[str, typer.Option(help="Remove measurements before this day (UTC), for example 2026-01-01.")],
    backup_to: Annotated[Path, typer.Option("--backup", help="A new folder to copy the whole journal to first.")],
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
    maintenance = JournalMaintenance(journal_folder(home()), *journal_of(settings({})))
    try:
        removed = maintenance.prune(day.isoformat(), backup_to)
        answer = {"removed": removed, "backup": str(backup_to)}
        print(json.dumps(answer) if as_json else f"events removed: {removed}; the complete journal is in {backup_to}")
    finally:
        maintenance.close()
