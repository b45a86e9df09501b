"""The fork server's own process, and what becomes of its children (see fork_server.py)."""

import atexit
import contextlib
import fcntl
import gc
import importlib
import json
import multiprocessing.util
import os
import runpy
import signal
import socket
import subprocess
import sys
import threading
import time
import traceback
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from fork_server import IGNORED, POOL_WORKER, ForkServer

IMPORTED = (
    "matplotlib.backends.backend_agg",
    "matplotlib.backends.backend_svg",
    "matplotlib.figure",
    "pydantic.type_adapter",
    "pyvisa_py",
    "pzctl.daemon.cli.commands",
    "pzctl.daemon.files.builds.build_file",
    "pzctl.daemon.report.json_output.fit_json",
    "pzctl.daemon.report.pictures.fit_pictures",
    "pzctl.daemon.report.tables.fit_tables",
    "pzctl.daemon.report.terminal",
    "pzctl.daemon.server.launch",
    "pzctl.daemon.server.workers.worker_main",
    "pzctl.drivers.agilent4294a.driver",
    "pzctl.drivers.agilent4294a.instrument",
    "pzctl.drivers.keysight_e4990a.driver",
    "pzctl.drivers.playback.played_recording",
    "pzctl.fitters.diagnosis.diagnose",
    "pzctl.fitters.layered.mason",
    "pzctl.sim.server",
)
"""What nearly every process of pzctl imports; more would make each fork slower."""
WITHOUT_CHILDREN = ("pzctl.daemon.server.analyzers.simulated_analyzer", "pzctl.daemon.server.workers.fitter_worker")
"""Modules that start no processes of pzctl, so they need no server."""
LARGEST_REQUEST = 1 << 20
MOST_FILES = 16


def main() -> None:
    """Serve requests at the socket of a given number; in each child, run what was asked for."""
    requests = socket.socket(fileno=int(sys.argv[1]))
    sys.path.remove(str(Path(__file__).parent))  # it was needed for the imports above only
    for name in IMPORTED:
        importlib.import_module(name)
    if len(list(Path("/proc/self/task").iterdir())) > 1:
        sys.exit("fork server: an import started a thread, so children cannot be forked")
    gc.collect()
    gc.freeze()  # a collection in a child would write to every page of memory, and so copy it
    while True:
        request, files = _serve(requests)
        _join(request)
        if request["words"][-1] == POOL_WORKER or request["words"][3:4] in WITHOUT_CHILDREN:
            break
        ours, requests = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        if os.fork():
            requests.close()
            server = ForkServer(ours, request["environment"])
            subprocess._fork_exec, multiprocessing.util.spawnv_passfds = server.fork_exec, server.spawn
            break
        ours.close()  # the server of the new process, and so on
        for file in files:
            os.close(file)
    _equip(request, files)
    _run(request["words"])


def _serve(requests: socket.socket) -> tuple[dict[str, Any], list[int]]:
    """Fork a child for each request and return the request in the child; end when nobody is left who could ask."""
    for kind in IGNORED:
        signal.signal(kind, signal.SIG_IGN)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, IGNORED)  # the process that asked first may have blocked them
    while True:
        message, files, _, _ = socket.recv_fds(requests, LARGEST_REQUEST, MOST_FILES)
        if not message:
            os._exit(0)
        request = json.loads(message)
        if not (between := os.fork()):
            between = os.getpid()
            if not (child := os.fork()):
                requests.close()
                while os.getppid() == between and not request["waits"]:
                    time.sleep(0.0005)  # until it has its parent
                return request, files
            os.write(files[3], b"%d\n" % child)
            if request["waits"]:
                os.write(files[3], b"%d\n" % os.waitpid(child, 0)[1])
            os._exit(0)  # else the child becomes that of the process that asked
        os.waitpid(between, os.WNOHANG if request["waits"] else 0)
        for file in files:
            os.close(file)


def _join(request: Mapping[str, Any]) -> None:
    if request["session"]:
        os.setsid()
    elif request["group"]:
        os.setpgid(0, request["group"])


def _equip(request: Mapping[str, Any], files: Sequence[int]) -> None:
    """Give this process what a new program is given, and what an interpreter makes of it when it starts."""
    environment: dict[str, str] = request["environment"]
    more = environment.get("PYTHONPATH", "").split(os.pathsep)
    sys.path[:0] = [folder for folder in more if folder and folder not in sys.path]
    os.environ.clear()
    os.environ.update(environment)
    os.chdir(request["folder"])
    time.tzset()
    for number, file in enumerate(files[:3]):
        os.dup2(file, number)
    for number, (name, mode) in enumerate({"stdin": "r", "stdout": "w", "stderr": "w"}.items()):
        old = getattr(sys, name)
        stream = open(number, mode, encoding=old.encoding, errors=old.errors, closefd=False)  # noqa: SIM115
        stream.reconfigure(line_buffering=name == "stderr" or stream.isatty())
        setattr(sys, name, stream)
        setattr(sys, f"__{name}__", stream)
    for kind in IGNORED:
        usual = signal.default_int_handler if kind == signal.SIGINT else signal.SIG_DFL
        signal.signal(kind, signal.SIG_IGN if kind in request["ignored"] else usual)
    for file in files[:4]:
        os.close(file)
    _number(files[4:], request.get("passed", ()))
    if request.get("blocked"):
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])


def _number(files: Sequence[int], numbers: Sequence[int]) -> None:
    """Give files the numbers that they have in the process that passed them."""
    apart = [fcntl.fcntl(file, fcntl.F_DUPFD, max(numbers) + 1) for file in files]
    for file in files:
        os.close(file)
    for file, number in zip(apart, numbers, strict=True):
        os.dup2(file, number)
        os.close(file)


def _run(words: list[str]) -> None:
    """Run a module or a script and end as an interpreter does, but without taking its memory apart."""
    sys.orig_argv = words
    status: object = 0
    try:
        if words[-1] == POOL_WORKER:
            sys.argv = ["-c", POOL_WORKER]
            exec(words[words.index("-c") + 1], {"__name__": "__main__"})  # noqa: S102 - as an interpreter does
        elif words[0] == sys.executable:
            sys.argv = words[3:]
            sys.modules.pop(words[3], None)  # it runs as __main__
            runpy.run_module(words[3], run_name="__main__", alter_sys=True)
        else:
            sys.argv = words
            runpy.run_path(words[0], run_name="__main__")
    except SystemExit as ended:
        status = ended.code
        if isinstance(status, str):
            print(status, file=sys.stderr)
    except BaseException:
        traceback.print_exc()
        status = 1
    threading._shutdown()
    atexit._run_exitfuncs()
    with contextlib.suppress(OSError, ValueError):
        sys.stdout.flush()
    os._exit(status & 0xFF if isinstance(status, int) else bool(status))


if __name__ == "__main__":
    main()
