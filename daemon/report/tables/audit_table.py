"""Who did what, as a table."""

from collections.abc import Iterable

from rich.box import SIMPLE_HEAD
from rich.console import Console
from rich.markup import escape
from rich.table import Table

from ....models.base.names import shown
from ...journal.audit import AuditEntry


def print_audit(screen: Console, entries: Iterable[AuditEntry]) -> None:
    """Print one row for each entry. Names and sentences come from outside, so they are escaped."""
    table = Table(header_style="bold", box=SIMPLE_HEAD)
    for column in ("event", "time (UTC)", "who", "did", "of", "says"):
        table.add_column(column)
    for one in entries:
        who = f"{one.by} ({one.client})" if one.by else one.client
        of = f"{one.sample.name} {one.sample.step}" if one.sample else ""
        event = f"{one.station} {one.seq}".strip()
        row = (event, one.time[:19].replace("T", " "), who, one.did, of, one.says)
        table.add_row(*(escape(shown(cell)) for cell in row))
    screen.print(table)
