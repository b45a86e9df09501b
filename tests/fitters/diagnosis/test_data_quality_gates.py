"""Each data-quality gate on devices with one resonance: it finds the issue and its place, and nothing else."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.fitters.diagnosis.data_quality.data_gates import gate
from pzctl.fitters.diagnosis.data_quality.data_issues import DataCheck, DataIssue, Kind
from pzctl.fitters.diagnosis.data_quality.matched_filters import adjusted, standing, strongest
from pzctl.fitters.diagnosis.data_quality.passivity import active_bands
from pzctl.fitters.diagnosis.data_quality.pole_fit import Frame, PoleFit, fit_poles, linear_fit
from pzctl.fitters.diagnosis.data_quality.repeats import differences
from pzctl.fitters.diagnosis.data_quality.sampling import points_per_linewidth
from pzctl.fitters.diagnosis.data_quality.steps_and_glitches import find_abrupt, good_points, repaired
from pzctl.fitters.polarity import polarity_of, put_right
from pzctl.models.sweep import Sweep

N, NOISE, F_K = 401, 1e-4, 3e6
F = np.linspace(1e6, 6e6, N)
SIGMA = np.full(N, NOISE)


def resonant(q: float = 40.0, branch: float = 0.1, seed: int = 0, f_k: float = F_K) -> Sweep:
    """Return the recording of a lossy capacitor in parallel with one resonance, with noise."""
    w, x = 2j * np.pi * F, F / f_k
    Y = w * 1e-9 * (1 - 0.01j + branch / (1 - x**2 + 1j * x / q))
    rng = np.random.default_rng(seed)
    return Sweep(F, np.exp(NOISE * (rng.normal(size=N) + 1j * rng.normal(size=N))) / Y)


def times(sweep: Sweep, factor: object) -> Sweep:
    return replace(sweep, impedance=sweep.impedance * np.asarray(factor))


def by_poles(sweep: Sweep) -> PoleFit:
    return fit_poles(Frame.of(sweep, SIGMA, np.ones(N, np.bool_)))


@given(st.floats(5, 200), st.floats(1e-3, 0.3), st.integers(0, 5))
def test_an_inverted_recording_of_any_device_is_corrected(q: float, branch: float, seed: int) -> None:
    sweep = resonant(q, branch, seed)
    turned = {"inverted": -sweep.impedance, "conjugated": np.conj(sweep.impedance)}
    assert polarity_of(sweep) is None
    for how, Z in turned.items():
        right, told = put_right({"disk": (sweep,), "ml1": (replace(sweep, impedance=Z),)})
        assert told == {"ml1": how}
        for of_step in right.values():
            assert np.array_equal(of_step[0].impedance, sweep.impedance)


def test_a_band_of_negative_resistance_is_found_but_noise_around_zero_is_not() -> None:
    lossless = Sweep(F, resonant().impedance.imag * 1j)
    rng = np.random.default_rng(1)
    size = NOISE * np.abs(lossless.impedance)
    assert active_bands(replace(lossless, impedance=lossless.impedance + size * rng.normal(size=N)), SIGMA) == []
    taken = np.where((np.arange(N) >= 100) & (np.arange(N) < 160), -20 * size, 0.0)
    ((low, high),) = active_bands(replace(lossless, impedance=lossless.impedance + taken), SIGMA)
    assert low == pytest.approx(F[100], abs=9 * (F[1] - F[0]))
    assert high == pytest.approx(F[159], abs=9 * (F[1] - F[0]))


def test_repeats_agree_or_the_differing_band_is_named() -> None:
    first, second = resonant(seed=1), resonant(seed=2)
    assert differences([first, second, first]) == [(), (), ()]
    drifted = times(second, np.where(np.arange(N) >= 200, 1 + 20 * NOISE, 1.0))
    none, (issue,) = differences([first, drifted])
    assert none == ()
    assert issue.kind == "not repeated"
    assert issue.band_Hz == (pytest.approx(F[200], abs=15 * (F[1] - F[0])), F[-1])
    assert differences([]) == []
    assert differences([first, replace(second, frequency=F + 1.0)]) == [(), ()], "nothing is in common"


@pytest.mark.parametrize("q", [20.0, 60.0, 120.0])
def test_poles_fit_a_resonance_to_the_noise_with_its_frequency_and_width(q: float) -> None:
    fit = by_poles(resonant(q))
    assert fit.chi2_per_dof == pytest.approx(1, abs=0.2)
    pole = min(fit.poles, key=lambda one: abs(one.imag * np.sqrt(F[0] * F[-1]) - F_K))
    assert pole.imag * np.sqrt(F[0] * F[-1]) == pytest.approx(F_K, rel=1e-3)
    assert -pole.imag / pole.real / 2 == pytest.approx(q, rel=0.01)
    inside = fit.tangent().T @ fit.basis
    assert np.max(np.abs(inside)) < 1e-6 * np.max(np.abs(fit.tangent()))
    points, where = points_per_linewidth(fit, F)
    assert points == pytest.approx(F_K / q / (F[1] - F[0]), rel=0.02)
    assert where == pytest.approx(F_K, rel=1e-3)


def test_a_capacitor_has_no_resonance_to_count_points_in() -> None:
    fit = by_poles(resonant(branch=0.0))
    assert fit.chi2_per_dof == pytest.approx(1, abs=0.2)
    assert points_per_linewidth(fit, F) is None


@pytest.mark.parametrize(("first", "length"), [(250, 1), (60, 6), (330, None)])
def test_the_strongest_template_is_the_injected_artefact(first: int, length: int | None) -> None:
    stop = N if length is None else first + length
    amplitude, there = 0.01 + 0.005j, (np.arange(N) >= first) & (np.arange(N) < stop)
    sound = by_poles(resonant())
    disturbed = times(resonant(), np.where(there, 1 + amplitude, 1.0))
    fit = linear_fit(Frame.of(disturbed, SIGMA, np.ones(N, np.bool_)), sound.poles)
    best, *others = strongest(fit)
    assert (best.first, best.stop, best.is_step(N)) == (first, stop, length is None)
    assert best.amplitude == pytest.approx(amplitude, rel=0.1)
    assert all(one.score <= best.score for one in others)
    if length is None:
        assert standing(sound, best).score > 1000
        (held,) = adjusted(sound, [replace(best, amplitude=amplitude)])
        assert held.amplitude == pytest.approx(amplitude, abs=2 * NOISE), "the step was taken out already"


def test_in_noise_no_template_is_significant() -> None:
    for seed in range(20):
        assert strongest(by_poles(resonant(seed=seed)))[0].score < 50
        assert find_abrupt(resonant(seed=seed), SIGMA).flaws == ()


def test_steps_are_corrected_and_glitches_masked() -> None:
    sound = resonant()
    at = np.arange(N)
    factor = np.where(at >= 300, 1.02, 1.0) * np.where((at >= 120) & (at < 123), 0.997, 1.0)
    found = find_abrupt(times(sound, factor), SIGMA)
    glitch, step = found.flaws
    assert (glitch.first, glitch.stop) == (120, 123)
    assert (step.first, step.stop) == (300, N)
    assert np.flatnonzero(~found.good).tolist() == [120, 121, 122]
    assert np.array_equal(found.good, good_points(sound, found.flaws))
    put = repaired(times(sound, factor), found.flaws)[found.good] / sound.impedance[found.good]
    np.testing.assert_allclose(put, 1, atol=5 * NOISE)
    assert found.fit.chi2_per_dof == pytest.approx(1, abs=0.2)


@pytest.mark.parametrize("kind", get_args(Kind))
def test_every_kind_of_issue_is_a_sentence_with_its_place(kind: Kind) -> None:
    said = DataIssue(kind, (2e6, 3e6), 12.0, 0.02).says
    assert "from 2 to 3 MHz" in said
    assert "at 3 MHz" in DataIssue(kind, (2.999e6, 3e6)).says
    check = DataCheck("disk", 0, N, troubles=(DataIssue(kind, (2e6, 3e6)),))
    assert bool(check.abrupt) == (kind in ("step", "glitch"))
    if check.abrupt:
        assert "12 s after the sweep began" in said
        assert "2 %" in said


def test_a_resonance_narrower_than_two_points_is_no_glitch_but_a_step_stays_one() -> None:
    few = slice(None, None, 5)
    coarse = [_every(resonant(q=300.0, seed=seed), few) for seed in range(6)]
    for sweep in coarse:
        (check,) = gate({"disk": (sweep,)}).checks
        assert check.points_per_linewidth is None or check.points_per_linewidth < 2
        assert check.abrupt == ()
    jump = np.where(np.arange(coarse[0].frequency.size) > 60, 1.05, 1.0)
    (issue,) = gate({"disk": (times(coarse[0], jump),)}).checks[0].abrupt
    assert issue.kind == "step"
    assert issue.size == pytest.approx(0.05, rel=0.05)


def _every(sweep: Sweep, some: slice) -> Sweep:
    return replace(sweep, frequency=sweep.frequency[some], impedance=sweep.impedance[some])
