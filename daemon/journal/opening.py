"""Opening a journal in a folder or on a server; the only module that knows both kinds of store."""

from pathlib import Path

from .store import JournalError, Place, Store
from .stores.folder_store import FolderStore


def open_store(place: Place, *, write: bool) -> Store:
    """Open a journal; for writing, make its tables or migrate them to this version. Raises JournalError."""
    if isinstance(place, Path):
        return FolderStore(place, write=write)
    try:
        from .stores.postgres_store import PostgresStore
    except ModuleNotFoundError as error:
        raise JournalError(
            f"a journal on PostgreSQL needs {error.name}, which is not installed: pip install '{error.name}[binary]'"
        ) from None
    return PostgresStore(place, write=write)
