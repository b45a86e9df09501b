"""A journal's server that is gone is noticed in seconds, also by a reading thread that waits for its answer."""

from typing import Any

import pytest

from pzctl.daemon.journal.journal_reader import JournalReader
from pzctl.daemon.journal.store import JournalAway

psycopg: Any = pytest.importorskip("psycopg")


@pytest.mark.parametrize("write", [False, True])
def test_every_connection_is_watched_from_this_side(write: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    given: dict[str, Any] = {}

    def refused(_: str, **options: Any) -> None:
        given.update(options)
        raise psycopg.OperationalError("refused")

    monkeypatch.setattr(psycopg.Connection, "connect", refused)
    with pytest.raises(JournalAway):
        JournalReader("postgresql://pzctl@nowhere/record", write=write)
    silent = given["keepalives_idle"] + given["keepalives_interval"] * given["keepalives_count"]
    assert silent < 20, "the seconds after which clients of the daemon give up"
