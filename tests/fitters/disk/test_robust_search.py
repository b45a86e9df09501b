"""Constants of a disk beside something that changes parts of the band, and recordings with broadened resonances."""

from dataclasses import replace
from functools import lru_cache

import complex_ceramic
import numpy as np
import pytest

from pzctl.fitters.disk.two_d.broadened import LOSS, broadened, less_lossy
from pzctl.fitters.disk.two_d.reduced_disk_cache import loadable_disk, reduced_disk
from pzctl.fitters.disk.two_d.robust_search import robust_bottom
from pzctl.fitters.disk.two_d.tensor_coordinates import COORDINATES, tensor_block
from pzctl.fitters.engine.descent import descend
from pzctl.fitters.engine.objective import Objective
from pzctl.fitters.engine.parameters.coordinates import Coordinates
from pzctl.fitters.engine.recording import Recording
from pzctl.models.disk2d.disk_model import Disk2D
from pzctl.models.stack import CONSTANT
from pzctl.models.sweep import Sweep

TRUTH = complex_ceramic.TENSOR
RATIO = 4.0
F = np.linspace(0.7e6, 2.9e6, 201)

pytestmark = pytest.mark.usefixtures("own_cache")


@lru_cache(maxsize=1)
def disk() -> Disk2D:
    reduced = reduced_disk(RATIO, lambda _: None)[1]
    return Disk2D("disk", TRUTH, np.pi * (RATIO / 2 * 1e-3) ** 2, 1e-3, 7700.0, reduced, CONSTANT)


def recorded(impedance: np.ndarray) -> Recording:
    return Recording("disk", Sweep(F, impedance), disk(), np.full(F.size, 2e-4))


def test_what_changes_a_few_points_does_not_move_constants() -> None:
    """As satellites of a dot do: every tenth point is off by its own size."""
    lines = np.where(np.arange(F.size) % 10 == 3, 1.0 + 0.5j, 0.0)
    recording = recorded(disk().impedance(F) * np.exp(lines))
    names = tuple(f"disk.{name}" for name in COORDINATES)
    true = Coordinates((tensor_block("disk"),), disk().parameters(), names)
    start = true.x + 0.01 * np.random.default_rng(0).normal(size=true.x.size)
    objective = Objective([recording], true, ())
    x = start
    for scale in (0.3, 0.1, 0.03, 0.01):
        x = robust_bottom(objective, x, scale, 9).x
    by_squares = descend(Objective([replace(recording, misfit=0.3)], true, ()), start, 1e-3, 36).x
    robust, squares = (
        max(abs(true.forward(at)[0][f"disk.{name}.re"] / getattr(TRUTH, name).real - 1) for name in ("c11E", "c33E"))
        for at in (x, by_squares)
    )
    assert robust < 1e-3
    assert robust < 0.05 * squares


def test_a_broadened_recording_is_that_of_a_disk_with_more_loss() -> None:
    own = disk().parameters()
    lossier = dict(own)
    for name in ("c11E", "c12E", "c13E", "c33E", "c44E"):
        lossier[f"disk.{name}.im"] += LOSS * own[f"disk.{name}.re"]
    for name in ("e31", "e33", "e15"):
        lossier[f"disk.{name}.im"] += LOSS / 2 * own[f"disk.{name}.re"]
    assert less_lossy(lossier, "disk") == pytest.approx(own, rel=1e-9)
    Z = disk().impedance(F)
    seen = broadened(recorded(Z)).sweep.impedance
    within = slice(40, -40)
    off, before = (np.abs(np.log(disk().replace(lossier).impedance(F) / one))[within] for one in (seen, Z))
    assert np.median(off) < 0.02
    assert np.sqrt(np.mean(off**2)) < 0.1 * np.sqrt(np.mean(before**2))


@pytest.mark.long
def test_a_disk_with_loadable_faces_is_cached() -> None:
    first = loadable_disk(RATIO, lambda _: None)
    said: list[str] = []
    again = loadable_disk(RATIO, said.append)
    assert not said
    for one, other in zip(first.parts, again.parts, strict=True):
        np.testing.assert_array_equal(one.reduced.stiffness, other.reduced.stiffness)
        np.testing.assert_array_equal(one.axial, other.axial)
