"""Limits of the logs of child processes: their number and size."""

from contextlib import suppress
from pathlib import Path


def keep_newest(folder: Path, pattern: str, number: int, size: int) -> None:
    """Remove all but the newest logs of a kind, and all but the end of oversized ones."""
    logs = {path: path.stat() for path in folder.glob(pattern) if path.is_file() and not path.is_symlink()}
    newest_first = sorted(logs, key=lambda path: (logs[path].st_mtime_ns, path.name), reverse=True)
    for path in newest_first[:number]:
        keep_end(path, size)
    for path in newest_first[number:]:
        path.unlink(missing_ok=True)


def keep_end(path: Path, size: int) -> None:
    """Remove all but the last bytes of an oversized file; a file that cannot be changed stays as it is."""
    with suppress(OSError), path.open("r+b") as file:
        if file.seek(0, 2) > size:
            file.seek(-size, 2)
            end = file.read()
            file.seek(0)
            file.write(end)
            file.truncate()
