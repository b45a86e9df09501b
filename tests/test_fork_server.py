"""A process that the fork server forks has what a new interpreter has, and ends like one."""

import json
import multiprocessing
import multiprocessing.util
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from fork_server import ForkServer
from seen_by_a_worker import seen_by_a_worker

from pzctl.fitters.population.process_pool import process_pool

WORDS = [sys.executable, "-P", "-m", "seen_by_a_child"]
CHILD = """
import json, os, signal, sys, threading
def opened(fd):
    try:
        return int(fd) > 2 and os.readlink(f"/proc/self/fd/{fd}")
    except FileNotFoundError:  # this folder itself
        return None
seen = {
    "words": sys.argv[1:],
    "stdin": sys.stdin.read(),
    "folder": os.getcwd(),
    "variables": dict(os.environ),
    "path": sys.path[0],
    "ctrl-c": signal.getsignal(signal.SIGINT) is signal.default_int_handler,
    "default": signal.getsignal(signal.SIGTERM) is signal.SIG_DFL,
    "ignored": signal.getsignal(signal.SIGHUP) is signal.SIG_IGN,
    "parent": os.getppid(),
    "session": os.getsid(0) == os.getpid(),
    "main": sys.modules["__main__"].__spec__.name,
    "open": [link.split(":")[0] for link in map(opened, os.listdir("/proc/self/fd")) if link],
    "threads": threading.active_count(),
}
print(json.dumps(seen))
print("a line", file=sys.stderr)
sys.exit(7)
"""

WAITS = "import time; print('begun', flush=True); time.sleep(60)"
CTRL_C = f"try: {WAITS}\nexcept KeyboardInterrupt: print('stopped'); raise SystemExit(3)"
PARENT = f"""
import os, pathlib, subprocess, sys
if sys.argv[1:]:
    print(os.getppid(), pathlib.Path("/proc/self/cmdline").read_text().split("\\0")[2].rpartition("/")[2], flush=True)
    sys.exit(5)
print(subprocess.run({WORDS!r} + ["again"]).returncode)
"""


@pytest.fixture
def child(
    fork_server: ForkServer | None, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Callable[..., "subprocess.Popen[str]"]:
    """Return a function that starts a child with pipes, which runs a given program."""
    if fork_server is None:
        pytest.skip("there is no fork server on this system")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)

    def begin(program: str, *words: str, **how: Any) -> "subprocess.Popen[str]":
        (tmp_path / "seen_by_a_child.py").write_text(program, encoding="utf-8")
        pipes = dict.fromkeys(("stdin", "stdout", "stderr"), subprocess.PIPE)
        return subprocess.Popen([*WORDS, *words], **pipes, text=True, **how)

    return begin


def is_forked(process: "subprocess.Popen[str]") -> bool:
    return "forked_process" in Path(f"/proc/{process.pid}/cmdline").read_text(encoding="utf-8")


def seen(process: "subprocess.Popen[str]", stdin: str = "") -> dict[str, Any]:
    out, err = process.communicate(stdin)
    assert (process.returncode, err) == (7, "a line\n")
    found = json.loads(out)
    del found["open"], found["variables"]["PYTHONPATH"]
    return found


def test_it_is_given_what_a_new_interpreter_is_given(child, as_for_users, fork_server, tmp_path: Path) -> None:
    """As `subprocess` states it; and it inherits which signals are ignored."""
    how = {"env": {**os.environ, "ONE": "ä=1"}, "cwd": tmp_path, "start_new_session": True}
    before = signal.signal(signal.SIGHUP, signal.SIG_IGN)
    try:
        as_ever = seen(child(CHILD, "--one", "two words", **how), "said")
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(subprocess, "_fork_exec", fork_server.fork_exec)
            process = child(CHILD, "--one", "two words", **how)
            assert is_forked(process)
            forked = seen(process, "said")
    finally:
        signal.signal(signal.SIGHUP, before)
    assert as_ever["ctrl-c"]
    assert forked == as_ever


def test_it_has_no_other_open_files(child) -> None:
    out, _ = child(CHILD).communicate()
    assert json.loads(out)["open"] == ["socket"], "with which it asks its own fork server"


def test_a_worker_of_a_pool_is_forked_and_as_a_new_process(as_for_users, fork_server: ForkServer | None) -> None:
    if fork_server is None:
        pytest.skip("there is no fork server on this system")
    with process_pool(1) as pool:
        as_ever = pool.submit(seen_by_a_worker).result()
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(multiprocessing.util, "spawnv_passfds", fork_server.spawn)
        with process_pool(1) as pool:
            forked = pool.submit(seen_by_a_worker).result()
    assert [as_ever.pop("forked"), forked.pop("forked")] == [False, True]
    assert forked == as_ever


def test_ctrl_c_and_a_signal_end_it(child) -> None:
    for kind, program in ((signal.SIGINT, CTRL_C), (signal.SIGTERM, WAITS), (signal.SIGKILL, WAITS)):
        process = child(program)
        assert is_forked(process)
        assert process.stdout.readline() == "begun\n"
        process.send_signal(kind)
        out, _ = process.communicate()
        assert (process.returncode, out) == ((3, "stopped\n") if kind == signal.SIGINT else (-kind, ""))


def test_what_it_starts_is_forked_and_its_own_child(child) -> None:
    with child(PARENT) as process:
        assert process.stdout.read().split() == [f"{process.pid}", "forked_process.py", "5"]


def test_other_settings_of_the_interpreter_need_a_new_one(child) -> None:
    for variable in ("PYTHONUTF8", "LC_ALL", "LD_LIBRARY_PATH"):
        with child(WAITS, env={**os.environ, variable: "1"}) as process:
            assert not is_forked(process)
            process.kill()


def test_an_error_is_printed_and_its_status_is_one(child) -> None:
    for program, says in (("1 / 0", "ZeroDivisionError"), ("import sys; sys.exit('a sentence')", "a sentence\n")):
        with child(program) as process:
            assert says in process.stderr.read()
        assert process.returncode == 1
