"""Changes as they are at a bench: sharp resonances that drift, coils with a core, noise of one recording only."""

import numpy as np
import pytest

from pzctl.fitters.compare.compare import compare
from pzctl.fitters.compare.pair import pair_of
from pzctl.fitters.compare.resonances import fitted_poles, resonances_of
from pzctl.models.sweep import Sweep

F = np.linspace(0.8e6, 1.4e6, 101)
JW = 2j * np.pi * F
FINE = np.linspace(0.8e6, 1.4e6, 201)


def resonator(drift: float = 0.0, clamped: float = 1.0, f: np.ndarray = F) -> np.ndarray:
    """Impedance in ohm of 2 nF with two resonances, the sharper one of a third of the fine grid's step."""
    Y = 2j * np.pi * f * 2e-9 * clamped * (1 - 0.01j)
    for f0, q, c in ((0.981e6, 900, 1.2e-10), (1.213e6, 60, 8e-11)):
        Y = Y + 2j * np.pi * f * c / (1 - (f / f0 / (1 + drift)) ** 2 + 1j * f / f0 / q)
    return 1 / Y


def recorded(Z: np.ndarray, seed: int, noise: float = 1e-4, f: np.ndarray = F) -> Sweep:
    rng = np.random.default_rng(seed)
    return Sweep(f, Z * np.exp(noise * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size)) + 1e-3 * rng.normal()))


def coil(henry: float) -> np.ndarray:
    """Impedance in ohm of a coil whose permeability relaxes at 8 MHz, with 6 pF and a wire's skin effect."""
    z = JW * henry * (0.5 + 0.5 / (1 + 1j * F / 8e6)) + 0.5 * np.sqrt(1j * F / 1e6)
    return z / (1 + JW * 6e-12 * z)


def test_an_unresolved_resonance_is_one_pole() -> None:
    sweep = recorded(resonator(f=FINE), 1, f=FINE)
    pair = pair_of([sweep], [sweep])
    own = resonances_of(fitted_poles(pair.frequency, pair.before, pair.noise_before), pair.frequency, pair.before)
    assert own.poles.imag == pytest.approx([0.981e6, 1.213e6], rel=1e-4)
    assert own.q == pytest.approx([900, 60], rel=0.05)


@pytest.mark.long
def test_a_drift_of_a_sharp_resonance_is_no_change() -> None:
    before, after = recorded(resonator(f=FINE), 1, f=FINE), recorded(resonator(6e-4, 1.001, FINE), 2, f=FINE)
    found = compare([before], [after])
    assert found.verdict == "unchanged"
    assert found.probability > 0.9


@pytest.mark.long
@pytest.mark.long
def test_a_short_wire_at_a_sharp_resonance_that_drifted_is_named_with_its_size() -> None:
    """Removed; that it is named where it is inserted, too, tests/benchmarks/test_compare.py tells."""
    bare, wired = recorded(resonator(), 1), recorded(resonator(-4e-4) + JW * 6e-8 + 0.05, 2)
    (finding,) = compare([wired], [bare]).findings
    assert (finding.effect, finding.removed) == ("lead-inductance", True)
    size = finding.parameters["inductance"]
    assert size.value == pytest.approx(6e-8, abs=max(3 * size.u, 3e-9))
    assert size.u < 6e-9


@pytest.mark.parametrize("across", [False, True])
def test_a_coil_with_a_core_that_resonates_in_the_band_is_named_alone(across: bool) -> None:
    z, Z = coil(1e-5), resonator(2e-4)
    found = compare([recorded(resonator(), 1)], [recorded(1 / (1 / Z + 1 / z) if across else Z + z, 2)])
    assert found.verdict == "explained"
    (finding,) = found.findings
    assert finding.effect == ("shunt-inductance" if across else "series-coil")
    true = float(np.interp(np.sqrt(F[0] * F[-1]), F, z.imag / JW.imag))
    assert finding.parameters["inductance"].value == pytest.approx(true, rel=0.05)


def test_a_capacitor_is_named_whichever_recording_has_the_noise() -> None:
    Z = resonator()
    for noises in ((1e-3, 1e-5), (1e-5, 1e-3)):
        before, after = recorded(1 / (1 / Z + JW * 1e-9), 1, noises[0]), recorded(Z, 2, noises[1])
        (finding,) = compare([before], [after]).findings
        assert (finding.effect, finding.removed) == ("stray-capacitance", True)


@pytest.mark.long
def test_what_leaves_more_than_a_tenth_of_the_change_is_not_explained() -> None:
    u = np.linspace(0, 1, F.size)
    wired = (resonator() + JW * 2e-6) * np.exp(0.05 * np.sin(60 * u) * (1 + 1j * u))
    found = compare([recorded(resonator(), 1)], [recorded(wired, 2)])
    assert found.verdict in {"partly-explained", "unexplained"}
    assert found.leftover_Hz
    assert found.remaining.total > 0.1 * found.change
