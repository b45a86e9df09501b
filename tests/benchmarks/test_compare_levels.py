"""One device at two drive levels; tests/fitters/compare/test_levels.py has the lower one first.

Without a build the recordings are a nonlinear circuit's; with a build they are those of the simulated bench, whose disk
obeys Rayleigh's law in its strain.
"""

import numpy as np
import pytest
from driven_circuit import F, driven, noisy

from pzctl.daemon.files.builds.build_file import parse_build
from pzctl.fitters.compare.compare import compare
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.bench import Bench
from pzctl.sim.bench.jig import JIGS
from pzctl.sim.bench.sweep_effects import Effects
from pzctl.sim.instrument.axis import plain_axis
from pzctl.sim.instrument.sweep_timing import point_seconds


def test_a_lower_level_afterwards_is_told_by_the_same_numbers() -> None:
    levels = (1.0, 0.1)
    soft, lossy = 1.2e-4, 3e-3
    (before, at_before), (after, at_after) = (driven(volt, soft, lossy) for volt in levels)
    found = compare([noisy(F, before, levels[0], 1)], [noisy(F, after, levels[1], 2)])
    (finding,) = found.findings
    assert finding.effect == "drive-nonlinearity"
    largest = max(at_before, at_after)
    assert finding.parameters["softening"].value == pytest.approx(soft * largest / 2, rel=0.1), "frequency: the root"
    assert finding.parameters["loss"].value == pytest.approx(lossy * largest, rel=0.1)


def test_a_resonance_that_bends_in_both_recordings_is_named_alone() -> None:
    levels = (0.5, 1.0)
    soft, lossy = 2.4e-4, 3e-3
    (before, _), (after, largest) = (driven(volt, soft, lossy) for volt in levels)
    (finding,) = compare([noisy(F, before, levels[0], 1)], [noisy(F, after, levels[1], 2)]).findings
    assert finding.effect == "drive-nonlinearity"
    assert finding.parameters["softening"].value == pytest.approx(soft * largest / 2, rel=0.1)
    assert finding.parameters["exponent"].value == pytest.approx(1.0, abs=0.2), "Rayleigh's law"


def test_with_a_build_the_softening_is_per_strain() -> None:
    build = parse_build(
        """
        name = "S"
        diameter_mm = 16
        layers = [{ name = "disk", kind = "piezo", material = "Pz27", thickness_mm = 0.512 }]
        load = { back = "air", front = "air" }
        steps = [{ name = "disk", layers = ["disk"] }]
        """
    )
    bench = Bench(noise=False, jig=JIGS["ideal"], effects=Effects(strain_softening=2e3))
    sweeps: list[Sweep] = []
    for seed, level in enumerate((0.1, 1.0)):
        axis = plain_axis(
            parameter="FREQ", kind="LIN", start=3.4e6, stop=4.8e6, points=81, fixed_frequency=1e3, level=level,
            bandwidth=5, point_average=1,
        )  # fmt: skip
        sweeps.append(noisy(axis.frequency, bench.measure(axis, point_seconds(axis), False), level, seed))
    found = compare(sweeps[:1], sweeps[1:], build, "disk")
    (finding,) = found.findings
    assert (finding.effect, finding.where) == ("drive-nonlinearity", "layer:disk")
    softening, loss = finding.parameters["softening"], finding.parameters["loss"]
    assert softening.value == pytest.approx(2e3, rel=0.05)
    assert loss.value == pytest.approx(4 / (3 * np.pi), abs=max(0.05, 3 * loss.u))
