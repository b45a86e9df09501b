"""Validation of an explanation: held-out points, other samples, and whiteness of the residuals."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted
from pzctl.fitters.diagnosis.search.refit import as_refit
from pzctl.fitters.diagnosis.validation.bands import excess_of, guilty_bands
from pzctl.fitters.diagnosis.validation.cross_sample import carried_over
from pzctl.fitters.diagnosis.validation.held_out_misfit import held_out_chi2, unforeseen
from pzctl.fitters.diagnosis.validation.improvement import LeastSquares
from pzctl.fitters.diagnosis.validation.residual_summary import in_words, remainder
from pzctl.fitters.diagnosis.validation.whiteness_tests import period, uneven
from pzctl.fitters.engine.recording import Recording
from pzctl.models.base.arrays import Complexes

N = 801


def noise(seed: int) -> Complexes:
    rng = np.random.default_rng(seed)
    return rng.standard_normal(N) + 1j * rng.standard_normal(N)


def chi2(residual: Complexes) -> float:
    return float(np.mean(np.abs(residual) ** 2)) / 2


def test_noise_has_no_structure() -> None:
    assert not any(uneven(noise(seed), 1) or period(noise(seed)) for seed in range(300))


@pytest.mark.parametrize("seed", range(5))
def test_a_ripple_below_the_noise_is_detected_by_its_period(seed: int) -> None:
    hum = noise(seed) + 0.6 * np.sin(2 * np.pi * np.arange(N) / 13.0)
    assert chi2(hum) < 1.2
    found = period(hum)
    assert found is not None
    assert found == pytest.approx(13.0, rel=0.01)


@pytest.mark.parametrize("seed", range(5))
def test_a_few_outlying_points_are_located(seed: int) -> None:
    moved = noise(seed)
    moved[400:406] += 4 + 4j
    assert chi2(moved) < 1.3
    ((_, first, stop),) = uneven(moved, 1)
    assert first <= 402
    assert stop >= 404
    assert stop - first < 20


def test_noise_twice_as_large_as_stated_has_no_period() -> None:
    assert not any(period(2 * noise(seed)) for seed in range(50))


@given(st.integers(40, 740), st.integers(20, 60), st.floats(20, 200))
def test_bands_cover_the_excess(first: int, length: int, height: float) -> None:
    f = np.linspace(1e6, 5e6, N)
    excess = np.ones(N)
    excess[first : first + length] = height
    ((low, high),) = guilty_bands(f, excess)
    assert abs(low - f[first]) <= 8 * (f[1] - f[0])
    assert abs(high - f[min(first + length, N - 1)]) <= 8 * (f[1] - f[0])
    assert guilty_bands(f, np.ones(N)) == ()


def test_the_worst_band_comes_first_and_faint_ones_are_omitted() -> None:
    f, excess = np.arange(N, dtype=float), np.ones(N)
    excess[100:140], excess[300:340], excess[600:640] = 50.0, 2000.0, 10.0
    worst, second = guilty_bands(f, excess)
    assert 300 <= worst[0] + 8 < worst[1] <= 350
    assert 100 <= second[0] + 8 < second[1] <= 150
    before, after = noise(1), noise(2)
    (fall,) = excess_of([before], [after])
    assert np.sum(fall) == pytest.approx(N * (chi2(before) - chi2(after)))


def test_held_out_points_are_predicted_only_with_the_effect(lead_case) -> None:
    with_lead = held_out_chi2(lead_case.problem, lead_case.final)
    assert with_lead == pytest.approx(1, abs=0.4)
    assert held_out_chi2(lead_case.problem, lead_case.null) > 1000 * with_lead
    assert unforeseen(lead_case.problem, lead_case.final) == (), "a lead affects every band"


def test_another_sample_confirms_a_lead_it_shares_and_contradicts_one_it_lacks(lead_case, nothing) -> None:
    problem, final = lead_case.problem, lead_case.final
    same = carried_over(problem, final, "same jig", lead_case.task, lambda _: None)
    assert same.effects == ("lead-inductance at terminals",)
    assert same.chi2_per_dof_after < 1.5 < 1000 < same.chi2_per_dof_before
    assert "confirms this" in same.says
    better = carried_over(problem, final, "better jig", nothing, lambda _: None)
    assert better.chi2_per_dof_after > 4 * better.chi2_per_dof_before
    assert "contradicts" in better.says
    none = carried_over(problem, lead_case.null, "any", nothing, lambda _: None)
    assert none.effects == ()
    assert "None of the effects found" in none.says


def test_another_ceramic_behind_the_same_lead_confirms_it_to_the_noise(lead_case) -> None:
    """A fit without the lead leaves so much that its weights would let the constants go unfitted."""
    (disk,) = lead_case.stack.layers
    other = replace(disk, c33D=disk.c33D * 1.04, h33=disk.h33 * 0.97, eps33S=disk.eps33S * 1.03)
    (sweep,) = lead_case.task.sweeps["disk"]
    lead = 2j * np.pi * sweep.frequency * lead_case.inductance
    Z = replace(lead_case.stack, layers=(other,)).impedance(sweep.frequency) + lead
    task = replace(lead_case.task, sweeps={"disk": (replace(sweep, impedance=Z * np.exp(2e-4 * noise(3)[: Z.size])),)})
    same = carried_over(lead_case.problem, lead_case.final, "S2", task, lambda _: None)
    assert same.chi2_per_dof_after < 1.5 < 1000 < same.chi2_per_dof_before


def test_the_fit_that_is_shown_has_nothing_left_to_gain(lead_case) -> None:
    def erring(recording: Recording) -> Recording:
        sweep = recording.sweep
        gain = 1e-3 * np.sin(sweep.frequency / 1.3e6)
        return replace(recording, sweep=replace(sweep, impedance=sweep.impedance * np.exp(gain)))

    problem = replace(lead_case.problem, recordings=tuple(map(erring, lead_case.problem.recordings)))
    null, alone = (
        fitted(problem, effects, lead_case.search.best.values, rounds=2, near=True)
        for effects in ((), (lead_case.lead,))
    )
    without, with_it = LeastSquares.of(problem, null), LeastSquares.of(problem, alone)
    # errors of the instrument have left their part of the misfit to themselves in both fits
    assert with_it.chi2_per_dof < as_refit(problem, alone).chi2_per_dof
    assert without.chi2_per_dof < as_refit(problem, null).chi2_per_dof
    assert with_it.share_beside(without) == pytest.approx(1 - with_it.chi2_per_dof / without.chi2_per_dof)
    assert without.share_beside(with_it) == 0


def test_noise_leaves_no_residual_finding_and_a_line_is_located(lead_case) -> None:
    left = remainder(lead_case.final)
    assert (left.bands_Hz, left.poles, left.texture) == ((), (), None)
    assert in_words(left) == ""
    (sweep,) = lead_case.task.sweeps["disk"]
    f_k, q = 6.1e6, 60.0
    x = sweep.frequency / f_k
    line = 2j * np.pi * sweep.frequency * 2e-12 / (1 - x**2 + 1j * x / q)
    (own,) = lead_case.problem.recordings
    with_line = replace(sweep, impedance=1 / (1 / sweep.impedance + line))
    problem = replace(lead_case.problem, recordings=(replace(own, sweep=with_line),))
    left = remainder(as_refit(problem, lead_case.search.best))
    assert any(low <= f_k <= high for low, high in left.bands_Hz)
    assert left.poles[0].frequency_Hz == pytest.approx(f_k, rel=0.01)
    assert left.poles[0].q == pytest.approx(q, rel=0.5)
    assert left.poles[0].capacitance == pytest.approx(2e-12, rel=0.3)
    assert f"a resonance at {left.poles[0].frequency_Hz / 1e6:.4g} MHz" in in_words(left)
