"""`python -m pzctl.sim.blind_cases FOLDER SEED COUNT [JOBS]`: write cases, seal their truth and print its hash."""

import signal
import sys
from functools import partial
from multiprocessing import Pool
from pathlib import Path

from .case_files import make_case, seal


def main(folder: Path, seed: int, count: int, jobs: int) -> str:
    """Write the cases with several processes, which end with this one; return the hash of the truth."""
    with Pool(jobs, _leave_signals_to_the_parent) as pool:
        truths = pool.map(partial(make_case, folder / "cases", seed), range(count), chunksize=1)
    return seal(folder, truths)


def _leave_signals_to_the_parent() -> None:
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    signal.signal(signal.SIGTERM, signal.SIG_DFL)


def _end(*_: object) -> None:
    """Answer only the first signal: a second one would disturb the clean-up."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)
    raise KeyboardInterrupt


if __name__ == "__main__":
    target, *numbers = sys.argv[1:]
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, _end)
    try:
        print(main(Path(target), int(numbers[0]), int(numbers[1]), int(numbers[2]) if len(numbers) > 2 else 2))
    except KeyboardInterrupt:
        sys.exit(130)
