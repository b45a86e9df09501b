"""`python -m pzctl.sim.blind_cases FOLDER SEED COUNT [JOBS [WORLD]]`: write cases, seal their truth, print its hash."""

import signal
import sys
from collections.abc import Generator
from contextlib import contextmanager
from functools import partial
from multiprocessing import Pool
from pathlib import Path

from . import case_files
from .case_files import seal
from .lab import files as lab_files

_SIGNALS = signal.SIGINT, signal.SIGTERM
_WORLDS = {"ideal": case_files.make_case, "lab": lab_files.make_case}


def main(folder: Path, seed: int, count: int, jobs: int, world: str = "ideal") -> str:
    """Write the cases with several processes, which end with this process; return the hash of the truth."""
    with _signals_later():
        pool = Pool(jobs, _leave_signals_to_the_parent)
    with pool:
        truths = pool.map(partial(_WORLDS[world], folder / "cases", seed), range(count), chunksize=1)
    return seal(folder, truths)


@contextmanager
def _signals_later() -> Generator[None]:
    """Answer signals when a pool is complete: a process that is forked just then would be forgotten, and never end."""
    if not hasattr(signal, "pthread_sigmask"):  # Windows
        yield
        return
    before = signal.pthread_sigmask(signal.SIG_BLOCK, _SIGNALS)
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _leave_signals_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)
    if hasattr(signal, "pthread_sigmask"):
        signal.pthread_sigmask(signal.SIG_UNBLOCK, _SIGNALS)


def _end(*_: object) -> None:
    """Answer only the first signal: a second one would disturb the clean-up."""
    for number in _SIGNALS:
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


if __name__ == "__main__":
    target, *numbers = sys.argv[1:]
    for number in _SIGNALS:
        signal.signal(number, _end)
    try:
        jobs = int(numbers[2]) if len(numbers) > 2 else 2
        print(main(Path(target), int(numbers[0]), int(numbers[1]), jobs, numbers[3] if len(numbers) > 3 else "ideal"))
    except OSError as error:  # a full disk
        print(f"{error.filename or target}: the cases cannot be written: {error.strerror}", file=sys.stderr)
        sys.exit(1)
    except KeyboardInterrupt:
        sys.exit(130)
