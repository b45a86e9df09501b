"""Killing a child that hangs does not make the daemon hang, too."""

import signal
import subprocess
import sys
from pathlib import Path

import pytest

from pzctl.daemon.server.workers.subprocesses import kill_child, start_child

TRACE = """
import ctypes, sys, time
libc = ctypes.CDLL(None, use_errno=True)
done = libc.ptrace(0x4206, int(sys.argv[1]), None, None)  # PTRACE_SEIZE
print(done, flush=True)
time.sleep(600)
"""
"""A debugger: its child is gone for others only once it has looked."""


@pytest.mark.skipif(sys.platform != "linux", reason="ptrace is Linux's")
def test_a_child_that_does_not_end_when_killed_is_left(tmp_path: Path) -> None:
    """Such as one that waits for a dead share: the daemon answered nobody until it ended."""
    with (tmp_path / "log").open("wb") as log:
        child = start_child("code", [], log, stdout=log, environment={})
        with subprocess.Popen([sys.executable, "-c", TRACE, str(child.pid)], stdout=subprocess.PIPE) as debugger:
            try:
                assert debugger.stdout is not None
                if debugger.stdout.readline().strip() != b"0":
                    kill_child(child)
                    pytest.skip("this system allows no debugger")
                kill_child(child)
                assert child.returncode is None
            finally:
                debugger.kill()
        assert child.wait(60) == -signal.SIGKILL
