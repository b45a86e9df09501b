"""Processes of pzctl that begin with everything imported: forked children of a server instead of new interpreters.

A test run starts several hundred daemons, simulators, workers and commands. Most of their processor time is the import
of NumPy and of the package, the same in each. This server imports them once, before any thread or ZeroMQ context
exists, and forks itself on request. `forking` lets `subprocess` use it for the two ways in which pzctl is started:
`python -P -m MODULE ...` and the installed script `pzctl ...`; and `multiprocessing` for the workers of a pool, which
it calls spawned. Everything else is started as ever.

A forked process has its own arguments, environment, folder, standard streams, session and default signal handling, is
a child of the process that asked for it, and has a server of its own for the processes that it starts. Where this
cannot be had (not Linux, another interpreter, other settings of Python or of the language) it is started as ever.
"""

import contextlib
import ctypes
import json
import multiprocessing.util
import os
import signal
import socket
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any
from unittest import mock

SERVER = Path(__file__).with_name("forked_process.py")
SCRIPT = Path(sys.executable).with_name("pzctl")
FIXED = ("PYTHON", "LC_", "LANG", "LD_")
"""Beginnings of the names of environment variables that an interpreter reads only when it starts."""
IGNORED = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Signals that a new program goes on ignoring if its parent does."""
FOR_A_SHELL = "PZCTL_FORK_SERVER"
"""The environment variable with the number of the file to which `forked_pzctl` writes a request."""
POOL_WORKER = "--multiprocessing-fork"
"""The last word of the command line by which `multiprocessing` starts the worker of a pool."""
_SUBREAPER = 36
"""PR_SET_CHILD_SUBREAPER of prctl(2)."""
_plain = getattr(subprocess, "_fork_exec", None)
_plain_spawn = getattr(multiprocessing.util, "spawnv_passfds", None)


class ForkServer:
    """The server of this process; started when the first process is."""

    def __init__(self, requests: socket.socket | None = None, environment: Mapping[str, str] | None = None) -> None:
        self._requests = requests
        self._process: subprocess.Popen[bytes] | None = None
        self._environment = dict(os.environ if environment is None else environment)
        self._lock = threading.Lock()

    def fork_exec(self, arguments: Sequence[Any], executable: Any, *rest: Any) -> int:
        """Return the process number of a new process; takes what `subprocess` hands to `fork_exec`."""
        close_fds, pass_fds, cwd, variables, stdin, _, _, stdout, _, stderr, _, errors = rest[:12]
        session, others = rest[13], (*rest[14:19], rest[19])
        words = [os.fsdecode(word) for word in arguments]
        environment = _environment(variables)
        folder = os.fsdecode(cwd) if cwd is not None else str(Path.cwd())
        if (
            tuple(pass_fds) != (errors,)
            or not close_fds
            or others != (-1, None, None, None, -1, None)
            or not Path(folder).is_dir()
            or _start(words) is None
            or _fixed(environment) != _fixed(self._environment)
        ):
            return _plain(arguments, executable, *rest)
        streams = [given if given != -1 else own for given, own in ((stdin, 0), (stdout, 1), (stderr, 2))]
        request = {"words": words, "environment": environment, "folder": folder, "session": session}
        request |= {"group": None, "waits": False}
        with self._lock:
            return self._ask({**request, "ignored": _ignored()}, streams)

    def spawn(self, executable: Any, arguments: Sequence[Any], passed: Sequence[int]) -> int:
        """Return the process number of a new process; takes what `multiprocessing` hands to `spawnv_passfds`.

        It keeps the numbers of the files passed, and a blocked Ctrl-C.
        """
        words, environment = [os.fsdecode(word) for word in arguments], dict(os.environ)
        if _start(words) is None or _fixed(environment) != _fixed(self._environment):
            return _plain_spawn(executable, arguments, passed)
        request = {"words": words, "environment": environment, "folder": str(Path.cwd()), "session": False}
        request |= {"group": None, "waits": False, "passed": list(passed), "ignored": _ignored()}
        request["blocked"] = signal.SIGINT in signal.pthread_sigmask(signal.SIG_BLOCK, [])
        with self._lock:
            return self._ask(request, [0, 1, 2], passed)

    def for_shell(self, folder: Path, path: str) -> tuple[dict[str, str], tuple[int, ...]]:
        """Return the environment and the files to be passed with which a shell's `pzctl` is forked by this server.

        The command is written into a folder, which comes before the other folders of PATH.
        """
        command = folder / "pzctl"
        text = Path(__file__).with_name("forked_pzctl.py").read_text(encoding="utf-8")
        command.write_text(f"#!{sys.executable} -IS\n{text}", encoding="utf-8")
        command.chmod(0o700)
        with self._lock:
            number = self._socket().fileno()
        return {"PATH": f"{folder}{os.pathsep}{path}", FOR_A_SHELL: str(number)}, (number,)

    def _socket(self) -> socket.socket:
        if self._requests is None:
            self._requests, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
            with theirs:
                number, null = theirs.fileno(), subprocess.DEVNULL
                words = [sys.executable, "-P", str(SERVER), str(number)]
                path = os.pathsep.join([str(SERVER.parent), *filter(None, [self._environment.get("PYTHONPATH")])])
                environment = {**self._environment, "PYTHONPATH": path}
                self._process = subprocess.Popen(words, env=environment, pass_fds=[number], stdin=null, stdout=null)
        return self._requests

    def close(self) -> None:
        """End the server of this process."""
        if self._requests is not None:
            self._requests.close()
        if self._process is not None:
            self._process.wait()

    def _ask(self, request: Mapping[str, Any], streams: Sequence[int], passed: Sequence[int] = ()) -> int:
        requests = self._socket()
        ours, theirs = os.pipe()
        _adopt_orphans(True)
        try:
            with open(ours, "rb") as answer:  # noqa: PTH123 - a number
                socket.send_fds(requests, [json.dumps(request).encode()], [*streams, theirs, *passed])
                os.close(theirs)
                return int(answer.read())  # the end of the file says that the child is ours
        finally:
            _adopt_orphans(False)


@contextlib.contextmanager
def forking() -> Iterator[ForkServer | None]:
    """Let `subprocess` and `multiprocessing` start processes by a fork server; give None where there can be none."""
    if sys.platform != "linux" or _plain is None or _plain_spawn is None:
        yield None
        return
    with contextlib.closing(ForkServer()) as server, _started_by(server.fork_exec, server.spawn):
        yield server


@contextlib.contextmanager
def new_interpreters() -> Iterator[None]:
    """Let everything be started as ever, as for a user."""
    with _started_by(_plain, _plain_spawn):
        yield


@contextlib.contextmanager
def _started_by(fork_exec: Any, spawn: Any) -> Iterator[None]:
    with (
        mock.patch.object(subprocess, "_fork_exec", fork_exec, create=True),
        mock.patch.object(multiprocessing.util, "spawnv_passfds", spawn, create=True),
    ):
        yield


def _environment(variables: Sequence[bytes] | None) -> dict[str, str]:
    if variables is None:
        return dict(os.environ)
    return dict(os.fsdecode(entry).split("=", 1) for entry in variables)


def _ignored() -> list[int]:
    return [kind for kind in IGNORED if signal.getsignal(kind) is signal.SIG_IGN]


def _start(words: Sequence[str]) -> str | None:
    """Return the module, the script or the pool's worker that a command line runs, or None for anything else."""
    if words[:3] == [sys.executable, "-P", "-m"]:
        return words[3]
    if words[-1] == POOL_WORKER and "-c" in words:
        return words[-1]
    return words[0] if Path(words[0]) == SCRIPT else None


def _fixed(environment: Mapping[str, str]) -> dict[str, str]:
    return {k: v for k, v in environment.items() if k.startswith(FIXED) and k != "PYTHONPATH"}


def _adopt_orphans(whether: bool) -> None:
    """Let processes whose parent ends become children of this process, or no longer."""
    ctypes.CDLL(None).prctl(_SUBREAPER, int(whether), 0, 0, 0)
