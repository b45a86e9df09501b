"""The user's data folder, from the environment variable `PZCTL_HOME`, which only this module reads.

The module is part of `fitters` because fitters keep a cache in that folder and cannot import from the daemon.
"""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

_VARIABLE = "PZCTL_HOME"


def chosen_folder() -> Path | None:
    """Return the folder that `PZCTL_HOME` names; None if it is not set."""
    given = os.environ.get(_VARIABLE)
    return Path(given).expanduser() if given else None


def user_effects_folder(home: Path) -> Path:
    """Return the folder of the user's own effects, one NAME.toml each, in a data folder."""
    return home / "effects"


@contextmanager
def in_folder(folder: Path) -> Generator[None]:
    """Set `PZCTL_HOME` to another folder for this process and its children while the context is active."""
    before = os.environ.get(_VARIABLE)
    os.environ[_VARIABLE] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[_VARIABLE]
        else:
            os.environ[_VARIABLE] = before
