"""Where pzctl keeps its things: `PZCTL_HOME`, or the user's data directory."""

import tempfile
from pathlib import Path

import platformdirs

from ...fitters.data_folder import chosen_folder
from ...models.base.errors import PzctlError


class FolderError(PzctlError):
    """The data folder cannot be made or written."""


_TRIAL = 64 << 10
"""Bytes: an empty file finds its place on a full disk as well."""

REMEDY = "set PZCTL_HOME to a folder that can be"


def home() -> Path:
    """Return the data folder, made if it is not there: `PZCTL_HOME`, or the platform's user data directory.

    Raises FolderError.
    """
    folder = chosen_folder() or platformdirs.user_data_path("pzctl", appauthor=False)
    try:
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    except OSError as error:
        raise FolderError(f"the data folder {folder} cannot be made: {error.strerror}; {REMEDY}") from None
    return folder


def writable_home() -> Path:
    """Return the data folder, after a try whether it can be written. Raises FolderError."""
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
    """Return the folder of events that the journal's server was not there to take."""
    return home / "unsaved"


def daemon_file(home: Path) -> Path:
    """Return the file that says where the running daemon is."""
    return home / "daemon.json"


def keys_folder(home: Path) -> Path:
    """Return the folder of the keys: the daemon's, and those of the clients that may come in."""
    return home / "keys"


def seal_key(home: Path) -> tuple[Path, Path]:
    """Return the files of the private and the public key that the journal is sealed with."""
    return home / "seal" / "private.pem", home / "seal" / "public.pem"


def compensation_file(home: Path) -> Path:
    """Return the file that says when the instrument's compensation was taken."""
    return home / "compensation.json"


def log_file(home: Path, name: str) -> Path:
    """Return the log of a process (`daemon`, `sim`, `fitter-mason`), its folder made."""
    folder = home / "log"
    folder.mkdir(parents=True, exist_ok=True)
    return folder / f"{name}.log"
