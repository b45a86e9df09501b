"""The hash chain: an entry for every row in the order of writing, each linked to the one before.

A link is the SHA-256 of the previous link, of the entry's number, and of the written table, key and digest of the
row. A changed row gets another entry, a removed row an entry with an empty digest. Entries are never removed, not even
by `prune`, so that a seal can always be checked. Each station has a chain of its own. The station's name is in no
digest, so that a copy under another name keeps the chain.
"""

from typing import Any, Protocol

from ...wire.frames import to_json
from ..store import digest_of

COLUMNS = {
    "runs": "id, time",
    "measurements": "id, request, run, sample, step, build, state, time",
    "events": "seq, kind, id, measurement, topic, header, lengths, hash",
    "fits": "kind, sweeps, fitter, version, measurement, ok, seq",
    "prunings": "seq, time, backup",
    "gaps": "first, last, time, says",
}
"""The hashed columns of each table: all but the station. A build is identified by its hash in `measurements`."""

_ORDER = {
    "runs": "number",
    "measurements": "number",
    "fits": "seq",
    "prunings": "seq",
    "gaps": "first",
}

GENESIS = digest_of(b"pzctl journal chain 1")
"""The link before the first entry."""

_AT_ONCE = 500
"""Number of events to read at a time while a chain is made for an older journal."""


class Statements(Protocol):
    """Runs SQL with `?` for each value: a store, or a database during a migration."""

    def all(self, sql: str, *values: str | int) -> list[tuple[Any, ...]]:
        """Return the rows that a statement selects."""
        ...

    def run(self, sql: str, *values: Any) -> None:
        """Run a statement that changes rows or tables."""
        ...


def row_key(table: str, row: tuple[Any, ...]) -> str:
    """Return the key of a row, given as its hashed columns."""
    return digest_of(to_json(row[:4])) if table == "fits" else str(row[0])


def row_digest(row: tuple[Any, ...]) -> str:
    """Return the hash of a row's columns."""
    return digest_of(to_json(row))


def link_after(link: str, number: int, table: str, key: str, digest: str) -> str:
    """Return the link of an entry that follows `link`."""
    return digest_of(to_json([link, number, table, key, digest]))


def head_of(db: Statements, station: str) -> tuple[int, str]:
    """Return the number and the link of a station's last entry."""
    rows = db.all("SELECT number, link FROM chain WHERE station = ? ORDER BY number DESC LIMIT 1", station)
    return (rows[0][0], rows[0][1]) if rows else (0, GENESIS)


def chain_row(db: Statements, station: str, table: str, row: tuple[Any, ...]) -> None:
    """Add an entry for a row, given as its hashed columns; call it inside the transaction that writes the row."""
    _append(db, station, table, row_key(table, row), row_digest(row))


def chain_found(db: Statements, station: str, table: str, where: str, *values: str | int) -> None:
    """Add entries for the rows of a station that meet the SQL condition, as they are in the table now."""
    order = _ORDER.get(table, "seq")
    sql = f"SELECT {COLUMNS[table]} FROM {table} WHERE station = ? AND {where} ORDER BY {order}"  # noqa: S608
    for row in db.all(sql, station, *values):
        chain_row(db, station, table, row)


def chain_removed(db: Statements, station: str, table: str, where: str, *values: str | int) -> None:
    """Add entries for the removal of the rows of a station that meet the SQL condition."""
    sql = f"SELECT {COLUMNS[table]} FROM {table} WHERE station = ? AND {where} ORDER BY {_ORDER[table]}"  # noqa: S608
    for row in db.all(sql, station, *values):
        _append(db, station, table, row_key(table, row), "")


def chain_existing(db: Statements) -> None:
    """Make the chain of a journal that has none, with an entry for every row."""
    for (station,) in db.all("SELECT DISTINCT station FROM runs UNION SELECT DISTINCT station FROM events"):
        for table in ("runs", "prunings", "measurements"):
            chain_found(db, station, table, "TRUE")
        last = 0
        sql = f"SELECT {COLUMNS['events']} FROM events WHERE station = ? AND seq > ? ORDER BY seq LIMIT {_AT_ONCE}"  # noqa: S608
        while rows := db.all(sql, station, last):
            for row in rows:
                chain_row(db, station, "events", row)
            last = rows[-1][0]
        chain_found(db, station, "fits", "TRUE")


def _append(db: Statements, station: str, table: str, key: str, digest: str) -> None:
    before, link = head_of(db, station)
    number = before + 1
    db.run(
        "INSERT INTO chain (station, number, kind, subject, digest, link) VALUES (?, ?, ?, ?, ?, ?)",
        *(station, number, table, key, digest, link_after(link, number, table, key, digest)),
    )
