"""`python -m pzctl.sim.concealed FOLDER SEED COUNT [JOBS]`: write cases, seal their truth, print its hash."""

import sys
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

from .files import make_case, seal


def main(folder: Path, seed: int, count: int, jobs: int) -> str:
    """Write the cases in several processes; return the hash of the truth."""
    with ProcessPoolExecutor(jobs) as pool:
        truths = list(pool.map(partial(make_case, folder / "cases", seed), range(count)))
    return seal(folder, truths)


if __name__ == "__main__":
    target, *numbers = sys.argv[1:]
    print(main(Path(target), int(numbers[0]), int(numbers[1]), int(numbers[2]) if len(numbers) > 2 else 2))
