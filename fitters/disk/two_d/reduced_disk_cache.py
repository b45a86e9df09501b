"""Cache of reduced disks: computed once per geometry, in seconds to half a minute, then read in milliseconds."""

import os
import zipfile
from collections.abc import Callable
from math import exp, log
from pathlib import Path

import numpy as np
import platformdirs

from ....models.disk2d.full import FullDisk
from ....models.disk2d.reduced import ReducedDisk
from ....models.disk2d.training import trained
from ...data_folder import chosen_folder

_VERSION = 4
_GRID = 0.01
# D/t is rounded to 1 %; the basis is trained for ratios within +-2 %, and used with the disk's own sizes.
_EDGES = 10_000
# The electrodes' radius is rounded to this part of the disk's.


def cache_folder() -> Path:
    """Return the folder of reproducible files: `PZCTL_HOME`/cache, or the user's cache folder."""
    chosen = chosen_folder()
    return chosen / "cache" if chosen is not None else platformdirs.user_cache_path("pzctl", appauthor=False)


def reduced_disk(
    diameter_to_thickness: float, progress: Callable[[str], None], electrode: float = 1.0
) -> tuple[FullDisk, ReducedDisk]:
    """Return the mesh and the reduced disk for this D/t, from the cache if possible. Raises DiskError.

    `electrode`: radius of both electrodes over that of the disk, up to 1.
    """
    step, edge = round(log(diameter_to_thickness) / _GRID), round(electrode * _EDGES)
    ratio, electrode = exp(step * _GRID), edge / _EDGES
    file = cache_folder() / f"disk2d-{_VERSION}-{step}-{edge}.npz"
    full = FullDisk.of(ratio, electrode=electrode)
    known = _read(file, full.size)
    if known is not None:
        return full, known

    def say(done: int, of: int) -> None:
        progress(f"reduced model for D/t {ratio:.3g}: {done} of {of} samples")

    reduced = trained(ratio, say, electrode)
    _write(file, reduced)
    return full, reduced


def _read(file: Path, unknowns: int) -> ReducedDisk | None:
    """Return the reduced disk of a file; None if there is no readable file."""
    try:
        with file.open("rb") as stream, np.load(stream) as arrays:
            reduced = ReducedDisk.from_arrays(arrays)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None
    return reduced if reduced.u.shape[0] == unknowns else None


def _write(file: Path, reduced: ReducedDisk) -> None:
    """Write the file atomically; if that fails, the model is computed again next time."""
    part = file.with_suffix(f".{os.getpid()}.part")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **reduced.arrays())
        part.replace(file)
    except OSError:
        part.unlink(missing_ok=True)
