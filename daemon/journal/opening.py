"""Opening a journal, wherever it is kept: the one module that knows both kinds of store."""

from pathlib import Path

from .folder_store import FolderStore
from .store import JournalError, Place, Store


def open_store(place: Place, *, write: bool) -> Store:
    """Open a journal; where it is to be written its tables are made, or brought up to date. Raises JournalError."""
    if isinstance(place, Path):
        return FolderStore(place, write=write)
    try:
        from .postgres_store import PostgresStore
    except ModuleNotFoundError as error:
        raise JournalError(
            f"a journal on PostgreSQL needs {error.name}, which is not installed: pip install 'pzctl[postgres]'"
        ) from None
    return PostgresStore(place, write=write)
