"""Default signal handling, the open cases, and real recordings; without the latter, tests skip with a reason."""

import gc
import os
import signal
import sys

# Under `nohup` or `&` in a script pytest ignores Ctrl-C. Children would inherit this and could not be interrupted.
if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    signal.signal(signal.SIGINT, signal.default_int_handler)

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # before NumPy: parallel tests share two cores
# One fitter in daemons that the command line starts; the second, which only compares, has tests that name it.
os.environ.setdefault("PZCTL_FITTERS", "mason")
if os.environ.pop("PYTHONDONTWRITEBYTECODE", None):
    sys.dont_write_bytecode = False  # otherwise each of a thousand processes compiles the package again

import shutil
import subprocess
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest
from fork_server import ForkServer, forking, new_interpreters
from running_order import in_shares

ROOT = Path(__file__).resolve().parents[1]


TESTS = ROOT / "tests"
SUPPORT = TESTS / "support"

IN_MEMORY = Path("/dev/shm")  # noqa: S108 (only pytest's own folders are made there)
MOST_FILES = 2 << 30
"""Bytes, several times what the folders of all tests hold at the same time."""


def _holds_tests(folder: Path) -> bool:
    """Return whether the folders of all tests fit into a folder, and commands written there may be run."""
    if not (sys.platform == "linux" and os.access(folder, os.W_OK)):
        return False
    return shutil.disk_usage(folder).free > MOST_FILES and not os.statvfs(folder).f_flag & os.ST_NOEXEC


# A disk keeps tests waiting that write journals, and then for a minute until the files of an earlier run are deleted.
if _holds_tests(IN_MEMORY):
    os.environ.setdefault("PYTEST_DEBUG_TEMPROOT", str(IN_MEMORY))

STARTS_PROCESSES = frozenset({"start_daemon", "start_program", "on_cores", "cluster", "odd_fitter"})
"""Fixtures that start processes."""
PROCESS_MODULES = frozenset({"subprocess", "multiprocessing", "postgres", "Browser", "start"})
"""Imported names by which a test module starts processes itself; the last two start a browser and a daemon."""


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers() -> int:
    """Return three workers more than there are cores: tests that start daemons wait for half of their time.

    With two more, a fifth of the time of two cores is not used.
    """
    return (os.cpu_count() or 1) + 3


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Run the longest tests first, in each process of a parallel run; mark tests that start processes as `system`.

    Such a test uses a fixture that starts one, or its module imports such a name.
    """
    shares = int(os.environ.get("PYTEST_XDIST_WORKER_COUNT", "1"))
    items[:] = in_shares(items, shares, lambda item: item.path.relative_to(TESTS).with_suffix("").as_posix())
    for item in items:
        imported = vars(item.module) if isinstance(item, pytest.Function) else {}
        fixtures = getattr(item, "fixturenames", ())
        if STARTS_PROCESSES.intersection(fixtures) or PROCESS_MODULES.intersection(imported):
            item.add_marker(pytest.mark.system)


def pytest_collection_finish() -> None:
    """Exempt what exists now, several thousand tests and all imports, from garbage collection: it is not garbage."""
    gc.collect()
    gc.freeze()


def _folder(variable: str, default: Path) -> Path:
    """Return the folder that an environment variable names, or the default; skip the test if it does not exist."""
    folder = Path(os.environ.get(variable, default)).resolve()
    if not folder.is_dir():
        pytest.skip(f"{folder} is absent; set {variable} to the folder of {default.name}")
    return folder


@pytest.fixture
def start_program() -> Iterator[Callable[..., "subprocess.Popen[Any]"]]:
    """Return `Popen` with a separate process group, which is killed if it still runs after the test."""
    started: list[subprocess.Popen[Any]] = []

    def begin(words: list[Any], **how: Any) -> "subprocess.Popen[Any]":
        started.append(subprocess.Popen(words, start_new_session=True, **how))
        return started[-1]

    yield begin
    for process in started:
        if process.poll() is None:
            os.killpg(process.pid, signal.SIGKILL)
            process.communicate()


@pytest.fixture(scope="session", autouse=True)
def fork_server() -> Iterator[ForkServer | None]:
    """Processes of pzctl begin as forked children of a server that has imported it; None where there is no server."""
    with forking() as server:
        yield server


@pytest.fixture
def as_for_users() -> Iterator[None]:
    """Processes of pzctl begin as new interpreters; for tests of how they begin and end."""
    with new_interpreters():
        yield


@pytest.fixture(scope="session")
def recordings() -> Path:
    """The folder of real recordings by others, which is not part of the repository."""
    return _folder("PZCTL_RECORDINGS", ROOT.parent / "shared" / "recordings")


@pytest.fixture(scope="session")
def cases() -> Path:
    """The folder of the ten open cases: devices of an independent simulation, with their truth."""
    return _folder("PZCTL_CASES", SUPPORT / "cases")


@pytest.fixture(scope="session")
def lab_cases() -> Path:
    """The folder of the nine open cases of the lab world, with their truth."""
    return _folder("PZCTL_CASES_LAB", SUPPORT / "cases-lab")


@pytest.fixture(scope="module")
def own_cache(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Keep reduced disks in a folder of the module's own."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("PZCTL_HOME", str(tmp_path_factory.mktemp("home")))
        yield
