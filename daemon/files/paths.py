"""The data folder, which is `PZCTL_HOME` or the user's data directory, and the paths in it."""

import tempfile
from pathlib import Path

import platformdirs

from ...fitters.data_folder import chosen_folder
from ...models.base.errors import PzctlError


class FolderError(PzctlError):
    """The data folder cannot be made or written."""


_TRIAL = 64 << 10
"""Bytes of the trial file; an empty file could be made on a full disk too."""

REMEDY = "set PZCTL_HOME to a folder that can be"


def home() -> Path:
    """Return the data folder, `PZCTL_HOME` or the platform's user data directory; make it if missing.

    Raises FolderError.
    """
    folder = chosen_folder() or platformdirs.user_data_path("pzctl", appauthor=False)
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise FolderError(f"the data folder {folder} cannot be made: {error.strerror}; {REMEDY}") from None
    return folder


def writable_home() -> Path:
    """Return the data folder after checking that it can be written. Raises FolderError."""
    folder = home()
    try:
        with tempfile.TemporaryFile(dir=folder) as trial:
            trial.write(bytes(_TRIAL))
    except OSError as error:
        raise FolderError(f"the data folder {folder} cannot be written: {error.strerror}; {REMEDY}") from None
    return folder


def journal_folder(home: Path) -> Path:
    """Return the folder of the journal: `journal.sqlite` and `arrays/`."""
    return home / "journal"


def unsaved_folder(home: Path) -> Path:
    """Return the folder of events that wait until the journal can be written again."""
    return home / "unsaved"


def daemon_file(home: Path) -> Path:
    """Return the file that says where the running daemon is."""
    return home / "daemon.json"


def keys_folder(home: Path) -> Path:
    """Return the folder of the daemon's key and of the keys of the clients that have access."""
    return home / "keys"


def seal_key(home: Path) -> tuple[Path, Path]:
    """Return the paths of the private and the public key that seal the journal."""
    return home / "seal" / "private.pem", home / "seal" / "public.pem"


def compensation_file(home: Path) -> Path:
    """Return the file that says when the instrument's compensation was taken."""
    return home / "compensation.json"


def backup_file(home: Path) -> Path:
    """Return the file with the time and the result of the last scheduled backups."""
    return home / "backup.json"


def log_file(home: Path, name: str) -> Path:
    """Return the path of a process's log (`daemon`, `sim`, `fitter-mason`); make its folder."""
    folder = home / "log"
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"{name}.log"
