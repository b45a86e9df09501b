"""Start a daemon in the background, and wait until it answers."""

import subprocess
import sys
import threading
import time
from contextlib import suppress
from dataclasses import asdict
from typing import IO, cast

import msgspec

from ...models.base.errors import PzctlError
from ..client.client import Client
from ..client.location import Location, find, same_resource
from ..client.protocol import DaemonError
from ..files.daemon_options import DaemonOptions
from ..files.paths import home, journal_folder, log_file, writable_home
from ..journal.folder_lock import is_written
from ..wire.frames import to_json
from .logs import begin_log
from .service import run
from .workers.subprocesses import last_line

PATIENCE = 60.0
"""Seconds within which a daemon answers, or does not."""


def running() -> Location | None:
    """Return where the daemon of the user's data folder is, if one answers there."""
    where = find(home())
    if where is None:
        return None
    try:
        with Client(where.events, where.requests, where.key) as client:
            return where if client.hello().run == where.run else None
    except DaemonError:
        return None


def start(options: DaemonOptions | None = None) -> Location:
    """Start a daemon in the background and return where it is; one that runs already is returned as it is.

    Raises DaemonError with the daemon's own sentence where it does not start, FolderError.
    """
    wanted = options or DaemonOptions()
    deadline = time.monotonic() + PATIENCE
    while find(home()) is None and is_written(journal_folder(home())) and time.monotonic() < deadline:
        time.sleep(0.05)  # one is just starting, or ending
    found = running()
    if found is not None:
        if wanted.resource is not None and not same_resource(wanted.resource, found.resource):
            raise DaemonError(
                f"a daemon runs already (process {found.pid}) and measures with {found.resource}, "
                f"not {wanted.resource}; end it first",
                "other-resource",
            )
        return found
    log = log_file(writable_home(), "daemon")
    with log.open("ab") as output:
        process = subprocess.Popen(
            [sys.executable, "-P", "-m", "pzctl.daemon.server.launch"],
            stdin=subprocess.PIPE,
            stdout=output,
            stderr=output,
            start_new_session=True,
        )
    with suppress(BrokenPipeError), cast("IO[bytes]", process.stdin) as told:
        told.write(to_json(asdict(wanted)))  # not as an argument: everybody can read those, and a URL's password
    threading.Thread(target=process.wait, daemon=True).start()  # it outlives us; if it does not, no zombie stays
    while time.monotonic() < deadline:
        where = find(home())
        if where is not None and where.pid == process.pid and (found := running()) is not None:
            return found
        if process.poll() is not None:
            if (found := running()) is not None:  # somebody else was quicker
                return found
            raise DaemonError(f"{last_line(log)} (log: {log})", "not-started")
        time.sleep(0.05)
    process.terminate()
    raise DaemonError(f"daemon: no answer within {PATIENCE:g} s of its start (log: {log})", "not-started")


def main() -> None:
    """Run a daemon with the options given as JSON on standard input; used by `start`."""
    begin_log(file=log_file(writable_home(), "daemon"))
    try:
        run(msgspec.json.decode(sys.stdin.buffer.read(), type=DaemonOptions))
    except PzctlError as error:
        print(error, file=sys.stderr)
        sys.exit(error.exit_status)


if __name__ == "__main__":
    main()
