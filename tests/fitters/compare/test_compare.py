"""Changes between two recordings: a few sharp cases; the benchmark has many."""

from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from pzctl.fitters.compare.compare import compare
from pzctl.fitters.compare.comparison import Comparison
from pzctl.fitters.interface import TaskError
from pzctl.models.sweep import Sweep

F = np.linspace(0.8e6, 1.4e6, 121)
JW = 2j * np.pi * F


def device(
    f: np.ndarray = F, *, shift: float = 1.0, q: float = 1.0, strength: float = 1.0, other: float = 0.0
) -> np.ndarray:
    """Impedance in ohm of a capacitance of 500 pF with two resonances, and a third of `other` farad."""
    Y = 2j * np.pi * f * 5e-10 * (1 - 0.01j)
    own = [(0.98e6, 120, 6e-11), (1.13e6, 90, 9e-12)]
    branches = [(f0 * shift, Q * q, c * strength) for f0, Q, c in own] + [(1.2e6, 80.0, other)]
    for f0, Q, c in branches:
        Y = Y + 2j * np.pi * f * c / (1 - (f / f0) ** 2 + 1j * f / f0 / Q)
    return 1 / Y


def recorded(Z: np.ndarray, seed: int, f: np.ndarray = F) -> Sweep:
    """Add the noise and the gain error of a bench."""
    rng = np.random.default_rng(seed)
    noise = 1e-4 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
    return Sweep(f, Z * np.exp(noise + 1e-3 * rng.normal()))


@cache
def changed(**change: float) -> Comparison:
    """Return what is found between the device before and after a change."""
    return compare([recorded(device(), 1)], [recorded(device(**change), 2)])


def line(Z: np.ndarray, length: float, Z0: float) -> np.ndarray:
    T = np.tanh(JW * length / 2e8)
    return Z0 * (Z + Z0 * T) / (Z0 + Z * T)


CHANGES: dict[str, tuple[Callable[[np.ndarray], np.ndarray], str, str, float]] = {
    "a coil in series": (lambda Z: Z + JW * 3e-5 + 0.8, "series-coil", "inductance", 3e-5),
    "a coil across": (lambda Z: 1 / (1 / Z + 1 / (JW * 2e-5 + 1)), "shunt-inductance", "inductance", 2e-5),
    "a cable": (lambda Z: line(Z, 3.0, 50.0), "cable", "length", 3.0),
}


@pytest.mark.parametrize(("name", "removed"), [*((name, False) for name in CHANGES), ("a cable", True)])
def test_an_inserted_or_removed_element_is_named_with_its_size(name: str, removed: bool) -> None:
    change, effect, size, true = CHANGES[name]
    bare, changed = recorded(device(), 1), recorded(change(device(F / 1.0001)), 2)
    found = compare([changed], [bare]) if removed else compare([bare], [changed])
    assert found.verdict == "explained"
    (finding,) = found.findings
    assert effect in (finding.effect, *(one.effect for one in finding.same_as))
    assert finding.removed == removed
    if finding.effect == effect:
        assert finding.parameters[size].value == pytest.approx(true, rel=0.05)
        assert effect not in [one.effect for one in found.limits], "a second one would share its size with the first"


@pytest.mark.long
def test_a_drifted_device_is_unchanged_and_limits_on_changes_are_given() -> None:
    found = compare([recorded(device(), 1)], [recorded(device(F / 1.0001), 2)])
    assert found.verdict == "unchanged"
    assert not found.findings
    limits = {one.effect: next(iter(one.upper_limit.values())).value for one in found.limits}
    assert limits["lead-inductance"] < 2e-8
    assert limits["stray-capacitance"] < 2e-12
    assert max(band.magnitude for band in found.repeatability) == pytest.approx(1e-2, rel=1)


@pytest.mark.long
@pytest.mark.parametrize(
    ("change", "effect", "size", "true"),
    [
        ({"shift": 0.997}, "frequency-shift", "shift", np.log(0.997)),
        ({"strength": 0.9}, "coupling-change", "ln strength", np.log(0.9)),
        ({"other": 2e-12}, "new-resonance", "frequency", 1.2e6),
    ],
)
def test_changes_in_the_device_are_named(change: dict[str, float], effect: str, size: str, true: float) -> None:
    found = changed(**change)
    assert found.verdict == "explained"
    (finding,) = found.findings
    assert finding.effect == effect
    assert finding.where == "layer:device"
    assert finding.parameters[size].value == pytest.approx(true, rel=0.05)


def test_a_new_resonance_has_the_frequency_and_the_q_of_its_branch() -> None:
    frequency, q = (changed(other=2e-12).findings[0].parameters[name] for name in ("frequency", "Q"))
    assert frequency.value == pytest.approx(1.2e6, abs=4 * frequency.u)
    assert frequency.u < 50
    assert q.value == pytest.approx(80, rel=0.02)


def test_a_change_of_strength_includes_no_drift_of_the_frequencies() -> None:
    found = compare([recorded(device(), 1)], [recorded(device(strength=0.8, shift=1.0004), 2)])
    (finding,) = found.findings
    strength = finding.parameters["ln strength"]
    assert finding.effect == "coupling-change"
    assert strength.value == pytest.approx(np.log(0.8), abs=3 * strength.u)
    assert strength.u < 5e-3


def test_a_change_in_the_device_is_known_no_better_than_the_usual_drift() -> None:
    assert changed(shift=0.997).findings[0].parameters["shift"].u == pytest.approx(1e-4, rel=0.5)


@pytest.mark.long
def test_a_network_analyzer_whose_calibration_moved_has_recorded_no_change() -> None:
    f, rng = np.linspace(0.7e6, 0.95e6, 101), np.random.default_rng(7)

    def reflected(match: float) -> Sweep:
        S = (device(f) - 50) / (device(f) + 50)
        S = S + 1e-3 + match * S**2 + 5e-5 * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        return Sweep(f, 50 * (1 + S) / (1 - S))

    found = compare([reflected(2e-3)], [reflected(3.2e-3)])
    assert found.verdict == "unchanged"
    assert not found.findings


@pytest.mark.long
def test_an_uncertain_change_is_not_reported_as_sure() -> None:
    rng = np.random.default_rng(5)
    noisy = [
        Sweep(F, Z * np.exp(0.02 * (rng.normal(size=F.size) + 1j * rng.normal(size=F.size)))) for Z in (device(),) * 2
    ]
    small = Sweep(F, noisy[1].impedance + 2.5)
    found = compare([noisy[0]], [small])
    assert found.verdict == "unchanged"
    assert found.probability < 0.9
    assert found.says[0].startswith(("Probably", "No change is sure"))


def test_the_table_of_resonances_lists_their_shifts() -> None:
    found = changed(shift=0.997)
    assert [one.frequency_Hz for one in found.resonances] == pytest.approx([0.98e6, 1.13e6], rel=1e-3)
    assert [one.shift for one in found.resonances] == pytest.approx([-3e-3] * 2, abs=1e-4)


@pytest.mark.long
def test_another_grid_is_interpolated() -> None:
    f = np.linspace(0.85e6, 1.5e6, 331)
    found = compare([recorded(device(), 1)], [recorded(device(f) + 2j * np.pi * f * 2e-7, 2, f)])
    assert [one.effect for one in found.findings] == ["lead-inductance"]
    assert found.findings[0].parameters["inductance"].value == pytest.approx(2e-7, rel=0.05)


def test_recordings_without_a_common_band_are_refused_in_a_sentence() -> None:
    f = np.linspace(2e6, 3e6, 201)
    with pytest.raises(TaskError, match=r"share no band: before is 800000-1.4e\+06 Hz, after is 2e\+06-3e\+06 Hz"):
        compare([recorded(device(), 1)], [recorded(device(f), 2, f)])


def test_one_recording_given_twice_is_refused_in_a_sentence() -> None:
    with pytest.raises(TaskError, match="hold the same numbers, noise included: one recording is given twice"):
        compare([recorded(device(), 1)], [recorded(device(), 1)])
