"""Child processes that end with their parent, however that ends."""

import os
import signal
import subprocess
import sys
import threading
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import IO

PATIENCE = 2.0
"""Seconds to wait for the end of a child that was told to end, and again for that of one that was killed."""


def start_child(
    module: str, arguments: Sequence[str], log: IO[bytes], *, stdout: IO[bytes] | int, environment: Mapping[str, str]
) -> "subprocess.Popen[bytes]":
    """Run a module of this package in a child process, with its standard error written to `log`.

    Its standard input is a pipe that ends with this process, which the child watches (`end_with_parent`). It has a
    session of its own, so that Ctrl-C reaches only the parent, which ends the child in an orderly way. Nothing is
    imported from the working directory (`-P`), which is the root of the file system, so that stray files beside the
    daemon are never run.
    """
    return subprocess.Popen(  # noqa: S603
        [sys.executable, "-P", "-m", module, *arguments],
        stdin=subprocess.PIPE,
        stdout=stdout,
        stderr=log,
        env={**os.environ, **environment},
        start_new_session=True,
        cwd=Path(sys.executable).anchor,
    )


def end_child(process: "subprocess.Popen[bytes]") -> None:
    """Terminate a child, or kill it if it does not end soon; close its pipes."""
    if process.poll() is None:
        process.terminate()
        if not _ends(process):
            process.kill()
            _ends(process)
    _close_pipes(process)


def kill_child(process: "subprocess.Popen[bytes]") -> None:
    """Kill a child that hangs, and its own children, at once; close its pipes."""
    if process.poll() is None:
        if sys.platform == "win32":
            process.kill()
        else:
            os.killpg(process.pid, signal.SIGKILL)  # start_child gave it a session, and so a process group, of its own
        _ends(process)
    _close_pipes(process)


def _ends(process: "subprocess.Popen[bytes]") -> bool:
    """Return whether a child ends soon; even a killed one does not while the system waits, for a dead share say."""
    with suppress(subprocess.TimeoutExpired):
        process.wait(PATIENCE)
    return process.returncode is not None


def _close_pipes(process: "subprocess.Popen[bytes]") -> None:
    for pipe in (process.stdin, process.stdout):
        if pipe is not None:
            pipe.close()


def end_with_parent() -> None:
    """End this process when its standard input ends; called by the child."""

    def watch() -> None:
        while os.read(0, 4096):  # not sys.stdin, whose lock would be held when the child ends by itself
            pass
        os._exit(0)

    threading.Thread(target=watch, daemon=True).start()


def last_line(path: Path) -> str:
    """Return the last line of a log that is not empty."""
    with path.open("rb") as file:
        file.seek(max(0, path.stat().st_size - 4000))
        lines = file.read().decode(errors="replace").split("\n")
    return next((line.strip() for line in reversed(lines) if line.strip()), "no output")
