"""The command line in this process: what a process of its own would print and return, without the half second."""

import contextlib
import io
import os
import subprocess
import sys
from collections.abc import Mapping
from pathlib import Path
from unittest import mock

from pzctl.daemon.cli import main
from pzctl.daemon.report.terminal import be_quiet

PZCTL = Path(sys.executable).with_name("pzctl")


def run_pzctl(home: Path, *words: str) -> "subprocess.CompletedProcess[str]":
    """Run a command that has to succeed in a process of its own, in its data folder."""
    environment = {**os.environ, "PZCTL_HOME": str(home), "OPENBLAS_NUM_THREADS": "1", "PYTHONPATH": ""}
    done = subprocess.run(
        [PZCTL, *words],
        env=environment,
        capture_output=True,
        text=True,
        check=False,
        cwd=home,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, done.stderr
    assert "Traceback" not in done.stderr
    return done


def run_here(
    home: Path, *words: object, environment: Mapping[str, str] | None = None
) -> "subprocess.CompletedProcess[str]":
    """Run a command in its data folder, or beside it if there is none yet, with more environment variables."""
    out, err = io.StringIO(), io.StringIO()
    argv = ["pzctl", *map(str, words)]
    with (
        mock.patch.object(sys, "argv", argv),
        mock.patch.object(sys, "stdin", io.StringIO()),
        mock.patch.dict(os.environ, {"PZCTL_HOME": str(home), **(environment or {})}),
        contextlib.chdir(home if home.is_dir() else home.parent),
        contextlib.redirect_stdout(out),
        contextlib.redirect_stderr(err),
    ):
        try:
            main()
            status: object = 0
        except SystemExit as ended:
            status = ended.code
        finally:
            be_quiet(False)
    return subprocess.CompletedProcess(argv, status if isinstance(status, int) else 0, out.getvalue(), err.getvalue())
