"""The audit entries of the journal as a table."""

from collections.abc import Iterable

from rich.box import SIMPLE_HEAD
from rich.console import Console

from ....models.base.names import shown
from ...journal.integrity.audit import AuditEntry
from .unbroken_table import Column, UnbrokenTable


def print_audit(screen: Console, entries: Iterable[AuditEntry]) -> None:
    """Print one row for each entry, with names and sentences from outside escaped."""
    table = UnbrokenTable("event", "time (UTC)", "who", "did", "of", Column("says", prose=True), box=SIMPLE_HEAD)
    for entry in entries:
        who = f"{entry.by} ({entry.client})" if entry.by else entry.client
        of = f"{entry.sample.name} {entry.sample.step}" if entry.sample else ""
        event = f"{entry.station} {entry.seq}".strip()
        row = (event, entry.time[:19].replace("T", " "), who, entry.did, of, entry.says)
        table.add_row(*(shown(cell) for cell in row))
    screen.print(table)
