"""Guides in a shell: blocks marked `<!-- run -->` are run, those marked `<!-- file: NAME -->` are written to files."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

from chromium import free_port
from fork_server import ForkServer

BLOCK = re.compile(r"<!-- (run|file: (\S+)) -->\n```\w*\n(.*?)```", re.DOTALL)
PORT = re.compile(r"port (\d{4})\b")
STARTED = re.compile(r"^(pzctl sim --port (\d+) .*&)\nsleep 3$", re.MULTILINE)
UNTIL_IT_LISTENS = r"""\1
for k in $(seq 600); do (: < /dev/tcp/127.0.0.1/\2) 2>/dev/null && break; sleep 0.1; done"""
"""A busy machine may take longer than three seconds, an idle one less."""


def run_guide(text: str, folder: Path, fork_server: ForkServer | None) -> None:
    """Run a guide on ports that no other run has; by new interpreters, as for a user, unless a server forks them."""
    path = f"{Path(sys.executable).parent}{os.pathsep}{os.environ['PATH']}"
    environment = {**os.environ, "PATH": path, "PZCTL_HOME": str(folder / "home")}
    files: tuple[int, ...] = ()
    if fork_server is not None:
        more, files = fork_server.for_shell(folder, path)
        environment |= more
    ports = {port: str(free_port()) for port in set(PORT.findall(text))}
    # all at once: a free port, 25026, may contain another one of the guide
    text = re.sub(r"\b\d{4}\b", lambda number: ports.get(number[0], number[0]), text)
    for kind, file, block in BLOCK.findall(STARTED.sub(UNTIL_IT_LISTENS, text)):
        if kind != "run":
            (folder / file).write_text(block, encoding="utf-8")
            continue
        shell = shutil.which("bash") or "/bin/sh"
        done = subprocess.run(
            [shell, "-em", "-c", block],
            cwd=folder,
            env=environment,
            capture_output=True,
            text=True,
            check=False,
            pass_fds=files,
        )
        assert done.returncode == 0, f"{block}\n{done.stdout[-1500:]}\n{done.stderr[-1500:]}"
        assert "Traceback" not in done.stderr
