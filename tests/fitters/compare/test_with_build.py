"""Changes inside of a device whose build is given.

The recordings come from the textbook formula of a piezoelectric plate between two acoustic loads (Kino, Acoustic Waves,
1987, section 1.4), not from the package's model, and have a lead and a spurious mode that the build knows nothing of.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.compare.compare import compare
from pzctl.fitters.compare.comparison import Comparison
from pzctl.fitters.interface import TaskError
from pzctl.models.sweep import Sweep

BUILD = read_build(THESIS_BUILD)
F = np.linspace(2e6, 6e6, 121)
JW = 2j * np.pi * F
AREA = np.pi * 8e-3**2


@dataclass(frozen=True)
class Disk:
    """A disk with glue and matching layer, SI units."""

    e33: float = 16.0
    c33E: complex = 1.13e11 * (1 + 0.012j)
    eps: complex = 8.1e-9 * (1 - 0.015j)
    glue: float = 12e-6
    matched: bool = True
    loose: float = 0.0
    """Part of the area without glue."""
    load: float = 413.0
    """Rayl, in front."""
    dead: float = 0.0
    """Depth in m under the back."""


def layer(behind: np.ndarray, z: complex, c: complex, thickness: float) -> np.ndarray:
    """Return the acoustic impedance in front of a layer."""
    tan = np.tan(2 * np.pi * F * thickness / c)
    return z * (behind + 1j * z * tan) / (z + 1j * behind * tan)


def plate(one: Disk, z_back: np.ndarray, z_front: np.ndarray) -> np.ndarray:
    """Return the impedance of the piezoelectric plate in ohm."""
    h, thickness = one.e33 / one.eps, 0.512e-3 - one.dead
    stiff = one.c33E + one.e33**2 / one.eps
    z0, phase = np.sqrt(7700 * stiff), 2 * np.pi * F * thickness / np.sqrt(stiff / 7700)
    a, b = z_back / z0, z_front / z0
    sin, cos = np.sin(phase), np.cos(phase)
    inner = 1j * (1j * (a + b) * sin - 2 * (1 - cos)) / ((a + b) * cos + 1j * (1 + a * b) * sin)
    live = (1 + h**2 * one.eps / stiff / phase * inner) * thickness
    return (live + one.dead) / (JW * one.eps * AREA)


def impedance(one: Disk) -> np.ndarray:
    """Return the impedance of the device, seen through the lead, with its spurious mode."""
    air = np.full(F.size, 413.0)
    back = layer(air, np.sqrt(7700 * one.c33E), np.sqrt(one.c33E / 7700), one.dead) if one.dead else air
    front = np.full(F.size, one.load)
    bare = plate(one, back, front)
    if one.matched:
        front = layer(front, 10.3e6 * (1 + 0.008j), 2455 * (1 + 0.008j), 0.139e-3)
        front = layer(front, 2.8e6 * (1 + 0.04j), 2450 * (1 + 0.04j), one.glue)
    glued = plate(one, back, front)
    Y = (1 - one.loose) / glued + one.loose / bare + JW * 4e-13 / (1 - (F / 3.1e6) ** 2 + 1j * F / 3.1e6 / 40)
    return 1 / Y + JW * 1e-8 + 0.02


def recorded(one: Disk, seed: int) -> Sweep:
    rng = np.random.default_rng(seed)
    noise = 1e-4 * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size))
    return Sweep(F, impedance(one) * np.exp(noise + 1e-3 * rng.normal()))


def compared(change: Callable[[Disk], Disk], step: str = "ml1") -> Comparison:
    device = Disk(matched=step != "disk")
    return compare([recorded(device, 1)], [recorded(change(device), 2)], BUILD, step)


@pytest.mark.parametrize(
    ("change", "effect", "where", "size", "true"),
    [
        (lambda one: replace(one, e33=15.2), "poling", "layer:disk", "ln e33", np.log(0.95)),
        (lambda one: replace(one, loose=0.2), "bond-void", "interface:disk|glue1", "fraction", 0.2),
        (lambda one: replace(one, load=4e5), "face-load", "face:front", "resistance", 4e5 - 413),
        (lambda one: replace(one, dead=15e-6), "surface-layer", "layer:disk", "back", 15e-6),
    ],
    ids=["depoled", "glue come off", "load", "dead layer"],
)
def test_a_change_inside_is_named_with_place_and_size_although_the_model_describes_neither_recording(
    change: Callable[[Disk], Disk], effect: str, where: str, size: str, true: float
) -> None:
    found = compared(change)
    assert found.verdict == "explained"
    (finding,) = found.findings
    assert (finding.effect, finding.where, finding.step, finding.removed) == (effect, where, "ml1", False)
    found_size = finding.parameters[size]
    assert found_size.value == pytest.approx(true, abs=max(3 * found_size.u, 0.05 * abs(true)))
    assert found_size.u < 0.15 * abs(true)
    assert found.described_by is not None
    assert found.described_by.rms_log_error > 20 * 2e-4, "the build lacks the lead and the spurious mode"


def test_a_load_that_is_gone_was_there_before() -> None:
    wet, dry = Disk(load=4e5), Disk()
    found = compare([recorded(wet, 1)], [recorded(dry, 2)], BUILD, "ml1")
    (finding,) = found.findings
    assert (finding.effect, finding.where, finding.removed) == ("face-load", "face:front", True)
    assert finding.parameters["resistance"].value == pytest.approx(4e5, rel=0.05)


@pytest.mark.parametrize("off", [False, True])
def test_a_matching_layer_that_came_on_or_off_is_that_of_the_neighbouring_step(off: bool) -> None:
    bare, glued = recorded(Disk(matched=False), 1), recorded(Disk(), 2)
    found = compare([glued], [bare], BUILD, "ml1") if off else compare([bare], [glued], BUILD, "disk")
    (finding,) = found.findings
    assert (finding.effect, finding.where, finding.removed) == ("glued-layer", "layer:ml1", off)
    assert finding.parameters["ml1.z"].value == pytest.approx(10.3e6, rel=0.06)


def test_an_unchanged_device_and_a_cable_are_still_what_they_are() -> None:
    assert compared(lambda one: one).verdict == "unchanged"
    before = recorded(Disk(), 1)
    after = replace(recorded(Disk(), 2), impedance=recorded(Disk(), 2).impedance + 10.0)
    (finding,) = compare([before], [after], BUILD, "ml1").findings
    assert (finding.effect, finding.where) == ("series-resistance", "terminals")


def test_a_step_that_the_build_has_not_is_refused_in_a_sentence() -> None:
    with pytest.raises(TaskError, match="step 'lens' is not in build 'thesis', which has disk, ml1, ml2"):
        compared(lambda one: one, "lens")
