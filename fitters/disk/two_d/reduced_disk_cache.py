"""Cache of reduced disks: computed once per geometry, in seconds to half a minute, then read in milliseconds."""

import os
import zipfile
from collections.abc import Callable, Mapping
from math import exp, log
from pathlib import Path
from typing import TypeVar

import numpy as np
import platformdirs

from ....models.base.arrays import Reals
from ....models.disk2d.full import FullDisk
from ....models.disk2d.loadable import LoadableDisk, trained_for_loads
from ....models.disk2d.odd_training import trained_odd
from ....models.disk2d.reduced import ReducedDisk
from ....models.disk2d.training import trained
from ...data_folder import chosen_folder

_Disk = TypeVar("_Disk", ReducedDisk, LoadableDisk)
_VERSION = 6
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
    step, edge, ratio, electrode = _rounded(diameter_to_thickness, electrode)
    file = cache_folder() / f"disk2d-{_VERSION}-{step}-{edge}.npz"
    full = FullDisk.of(ratio, electrode=electrode)
    known = _read(file, ReducedDisk.from_arrays)
    if known is not None and known.u.shape[0] == full.size:
        return full, known
    reduced = trained(ratio, _told(progress, f"reduced model for D/t {ratio:.3g}"), electrode)
    _write(file, reduced.arrays())
    return full, reduced


def loadable_disk(
    diameter_to_thickness: float, progress: Callable[[str], None], electrode: float = 1.0
) -> LoadableDisk:
    """Return the reduced disk whose faces can be loaded, from the cache if possible; parameters as `reduced_disk`."""
    step, edge, ratio, electrode = _rounded(diameter_to_thickness, electrode)
    said = _told(progress, f"reduced model with loaded faces for D/t {ratio:.3g}")
    name = f"disk2d-faces-{_VERSION}-{step}-{edge}"
    return _cached(name, LoadableDisk.from_arrays, lambda: trained_for_loads(ratio, said, electrode))


def odd_disk(diameter_to_thickness: float, progress: Callable[[str], None]) -> ReducedDisk:
    """Return the reduced disk of antisymmetric motion, from the cache if possible; as `reduced_disk`."""
    step, edge, ratio, _ = _rounded(diameter_to_thickness, 1.0)
    said = _told(progress, f"reduced model with unlike faces for D/t {ratio:.3g}")
    name = f"disk2d-odd-{_VERSION}-{step}-{edge}"
    return _cached(name, ReducedDisk.from_arrays, lambda: trained_odd(ratio, said))


def _cached(name: str, made_of: Callable[[Mapping[str, Reals]], _Disk], train: Callable[[], _Disk]) -> _Disk:
    """Return the disk of a file in the cache; it is trained and kept there if there is none."""
    file = cache_folder() / f"{name}.npz"
    known = _read(file, made_of)
    if known is not None:
        return known
    made = train()
    _write(file, made.arrays())
    return made


def _rounded(diameter_to_thickness: float, electrode: float) -> tuple[int, int, float, float]:
    """Return the numbers of a geometry's file, and its D/t and electrodes."""
    step, edge = round(log(diameter_to_thickness) / _GRID), round(electrode * _EDGES)
    return step, edge, exp(step * _GRID), edge / _EDGES


def _told(progress: Callable[[str], None], what: str) -> Callable[[int, int], None]:
    def say(done: int, of: int) -> None:
        progress(f"{what}: {done} of {of} samples")

    return say


def _read(file: Path, made_of: Callable[[Mapping[str, Reals]], _Disk]) -> _Disk | None:
    """Return what is made of the arrays of a file; None if there is no readable file."""
    try:
        with file.open("rb") as stream, np.load(stream) as arrays:
            return made_of(arrays)
    except (OSError, ValueError, KeyError, zipfile.BadZipFile):
        return None


def _write(file: Path, arrays: Mapping[str, Reals]) -> None:
    """Write the file atomically; if that fails, the model is computed again next time."""
    part = file.with_suffix(f".{os.getpid()}.part")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        with part.open("wb") as stream:
            np.savez(stream, allow_pickle=False, **arrays)
        part.replace(file)
    except OSError:
        part.unlink(missing_ok=True)
