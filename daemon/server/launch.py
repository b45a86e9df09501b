"""Starting a daemon in the background, and waiting until it answers."""

import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import asdict
from pathlib import Path
from typing import IO, cast

import msgspec

from ...models.base.errors import PzctlError
from ..client.client import Client
from ..client.location import Location, analyzer_at, find
from ..client.protocol import DaemonError
from ..files.daemon_options import DaemonOptions
from ..files.paths import home, journal_folder, log_file, writable_home
from ..journal.stores.folder_lock import is_written
from ..wire.frames import to_json
from .logs import begin_log
from .service import run
from .workers.subprocesses import last_line

PATIENCE = 60.0
"""Seconds within which a started daemon has to answer."""


def running() -> Location | None:
    """Return the location of the daemon of the user's data folder, or None if none answers."""
    location = find(home())
    if location is None:
        return None
    try:
        with Client(location.events, location.requests, location.key) as client:
            return location if client.hello().run == location.run else None
    except DaemonError:
        return None


def start(options: DaemonOptions | None = None) -> Location:
    """Start a daemon in the background and return its location, or that of the daemon that runs already.

    Raises DaemonError with the daemon's own sentence if it does not start, FolderError.
    """
    wanted = options or DaemonOptions()
    deadline = time.monotonic() + PATIENCE
    while find(home()) is None and is_written(journal_folder(home())) and time.monotonic() < deadline:
        time.sleep(0.05)  # a daemon is just starting or ending
    present = running()
    if present is not None:
        if wanted.resource is not None and analyzer_at(present, wanted.resource) is None:
            raise DaemonError(
                f"a daemon runs already (process {present.pid}) and measures with {present.resource}, "
                f"not {wanted.resource}; end it first",
                "other-resource",
            )
        return present
    log = log_file(writable_home(), "daemon")
    with log.open("ab") as output:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "pzctl.daemon.server.launch"],
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    with suppress(BrokenPipeError), cast("IO[bytes]", process.stdin) as stdin:
        stdin.write(to_json(asdict(wanted)))  # arguments would show a URL's password to every user of this machine
    threading.Thread(target=process.wait, daemon=True).start()  # leaves no zombie if it ends before this process
    try:
        return _answering(process, deadline, log)
    except KeyboardInterrupt:  # nobody would know of it
        process.terminate()
        raise


def _answering(process: "subprocess.Popen[bytes]", deadline: float, log: Path) -> Location:
    """Return the location of a daemon that was started, or of another one, once it answers. Raises DaemonError."""
    while time.monotonic() < deadline:
        location = find(home())
        if location is not None and location.pid == process.pid and (present := running()) is not None:
            return present
        if process.poll() is not None:
            if (present := running()) is not None:  # another process started one at the same time
                return present
            raise DaemonError(f"{last_line(log)} (log: {log})", "not-started")
        time.sleep(0.05)
    process.terminate()
    raise DaemonError(f"daemon: no answer within {PATIENCE:g} s of its start (log: {log})", "not-started")


def last_words(location: Location, since: float) -> str:
    """Return why a daemon in the background has ended after `since` (Unix time, s); "" if it did not say so."""
    log = Path(location.log)
    if not log.exists() or log.stat().st_mtime < since:
        return ""
    line = last_line(log)
    return "" if line[:4].isdigit() or line.startswith("{") else line  # an entry of the log, as text or JSON


def main() -> None:
    """Run a daemon with the options given as JSON on standard input; called by `start`."""
    begin_log(file=log_file(writable_home(), "daemon"))
    try:
        run(msgspec.json.decode(sys.stdin.buffer.read(), type=DaemonOptions))
    except PzctlError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_status)


if __name__ == "__main__":
    main()
