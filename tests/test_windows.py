"""As far as it can be told elsewhere, pzctl runs on Windows: without what only POSIX has, it is imported and fits."""

import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest

import pzctl
from pzctl.daemon.files.builds.build_file import THESIS_BUILD
from pzctl.drivers.recordings import write_csv
from pzctl.models.base.names import as_file_name

AS_ON_WINDOWS = textwrap.dedent("""
    import importlib, os, pkgutil, signal, socket, sys

    for name in sys.argv.pop(1).split(","):  # other packages choose their own branch while this is still POSIX
        importlib.import_module(name)
    for name in ("fcntl", "grp", "pty", "pwd", "resource", "termios", "tty"):
        sys.modules[name] = None
    absent = {
        os: "fork fchmod geteuid getuid killpg mkfifo nice posix_fadvise sched_getaffinity setsid statvfs sysconf",
        signal: "SIGALRM SIGCHLD SIGHUP SIGKILL SIGPIPE SIGQUIT SIGUSR1 SIGUSR2 pthread_sigmask setitimer",
        socket: "AF_UNIX SO_REUSEPORT TCP_INFO",
    }
    for module, names in absent.items():
        for name in names.split():
            if hasattr(module, name):
                delattr(module, name)
    sys.platform = "win32"

    import pzctl
    for found in pkgutil.walk_packages(pzctl.__path__, "pzctl."):
        if found.name.split(".")[1] in ("daemon", "drivers", "fitters", "models", "sim"):
            importlib.import_module(found.name)

    from pzctl.daemon.cli import main
    main()
""")
OTHERS = (
    "asyncio,concurrent.futures.process,cryptography,fpdf,h5py,ipywidgets,matplotlib.backends.backend_agg,msgspec,"
    "multiprocessing.util,numpy,platformdirs,pyvisa,pyvisa_py,rich.console,scipy.io,scipy.optimize,scipy.signal,"
    "scipy.special,starlette.staticfiles,typer,uvicorn,zmq.asyncio"
)


@pytest.mark.system
@pytest.mark.skipif(sys.platform == "win32", reason="there, every other test says it")
def test_every_module_is_imported_and_a_fit_runs(tmp_path: Path) -> None:
    f = np.linspace(1e6, 6e6, 101)
    Z = pzctl.model(THESIS_BUILD, "disk").impedance(f)
    noise = np.random.default_rng(1).normal(scale=3e-4, size=(2, f.size))
    write_csv(pzctl.Sweep(f, Z * np.exp(noise[0] + 1j * noise[1])), tmp_path / "disk.csv")
    words = ["fit", "--build", str(THESIS_BUILD), "disk=disk.csv", "--picture", "disk.png"]
    done = subprocess.run(
        [sys.executable, "-c", AS_ON_WINDOWS, OTHERS, *words], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    assert "disk.kt" in done.stdout
    assert (tmp_path / "disk.png").stat().st_size > 1000


@pytest.mark.parametrize(
    ("name", "file"), [("CON", "_CON"), ("aux.1", "_aux.1"), ("COM1", "_COM1"), ("S4. ", "S4"), ("console", "console")]
)
def test_a_sample_may_be_called_like_a_device_of_windows(name: str, file: str) -> None:
    assert as_file_name(name) == file
