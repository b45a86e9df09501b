"""The folder that a person chose for all that pzctl keeps; the one place that reads `PZCTL_HOME`.

It stands here because fitters keep a cache there, and nothing below the daemon may import from it.
"""

import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

_VARIABLE = "PZCTL_HOME"


def chosen_folder() -> Path | None:
    """Return the folder that `PZCTL_HOME` names, None where it names none."""
    given = os.environ.get(_VARIABLE)
    return Path(given).expanduser() if given else None


@contextmanager
def in_folder(folder: Path) -> Generator[None]:
    """Let this process, and those that it starts, work in another folder meanwhile."""
    before = os.environ.get(_VARIABLE)
    os.environ[_VARIABLE] = str(folder)
    try:
        yield
    finally:
        if before is None:
            del os.environ[_VARIABLE]
        else:
            os.environ[_VARIABLE] = before
