"""Populations: the thesis's printed tables, direct formulas, and small or awkward sets of samples."""

import math
from collections.abc import Mapping
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from pzctl.fitters.interface import Constant, FitResult, Noise
from pzctl.fitters.population.population_statistics import Population, population
from pzctl.fitters.population.random_effects import outliers, random_effects
from pzctl.models.build import Quantity

TABLE_4_8 = {
    "s11E": (1.4263 - 3.3624e-2j, 1.3740 - 1.2521e-2j, 1.4332 - 2.4562e-2j),
    "s12E": (-5.0937 - 3.7083e-1j, -6.9973 - 4.8490e-1j, -6.4920 - 5.6096e-1j),
    "d31": (-155.21 + 8.4805j, -127.60 + 7.6445j, -134.08 + 7.3514j),
    "eps33T": (1.5696 - 2.3037e-2j, 1.5097 - 1.5490e-2j, 1.6312 - 2.1468e-2j),
    "c11p": (7.0073 + 1.6520e-1j, 7.2773 + 6.6313e-2j, 6.9752 + 1.1954e-1j),
    "sigma_p": (0.3563 + 0.0344j, 0.5089 + 0.0399j, 0.4522 + 0.0469j),
    "kp": (0.5843 + 0.0023j, 0.5954 + 0.0067j, 0.5320 + 0.0233j),
    "eps33P": (1.0444 - 6.1164e-3j, 1.0272 - 1.2796e-3j, 1.1737 - 1.8252e-2j),
}
"""E. S. Tjelde, NTNU 2012: samples 4, 8 and 12, as printed."""

TABLE_4_9 = {
    "s11E": ((1.4112, 0.0010, 0.0324), (-0.0236, 0.0001, 0.0106)),
    "s12E": ((-6.1943, 0.9724, 0.9861), (-0.4722, 0.0092, 0.0957)),
    "d31": ((-138.9633, 208.4632, 14.4383), (7.8255, 0.3433, 0.5859)),
    "eps33T": ((1.5702, 0.0037, 0.0608), (-0.0200, 0.0000, 0.0040)),
    "c11p": ((7.0866, 0.0275, 0.1659), (0.1170, 0.0024, 0.0495)),
    "sigma_p": ((0.4391, 0.0059, 0.0771), (0.0404, 0.0000, 0.0063)),
    "kp": ((0.5706, 0.0011, 0.0339), (0.0108, 0.0001, 0.0111)),
    "eps33P": ((1.0818, 0.0064, 0.0801), (-0.0085, 0.0001, 0.0087)),
}
"""Mean, variance, standard deviation of real and imaginary part."""

FIT = FitResult("S", "f", "1", ("disk",), Noise(1e-3, "repeats"), 1.0, {}, {}, (), 0.01, True, 1, 0.1)


def fit(constants: Mapping[str, Constant]) -> FitResult:
    return replace(FIT, constants=constants)


def real(values: list[float], u: float | None, sheet: Quantity | None = None) -> Population:
    fits = {f"S{k}": fit({"a": Constant(v, 0.0, u, 0.0, "Pa")}) for k, v in enumerate(values)}
    return population(fits, {"a": sheet} if sheet else {})


def test_table_4_9_of_the_thesis_follows_from_its_table_4_8() -> None:
    fits = {
        f"S{n}": fit({name: Constant(v[k].real, v[k].imag, None, None, "1") for name, v in TABLE_4_8.items()})
        for k, n in enumerate((4, 8, 12))
    }
    found = population(fits, {}).constants
    for name, printed in TABLE_4_9.items():
        for part, (mean, variance, sd) in zip((found[name].re, found[name].im), printed, strict=True):
            assert part is not None
            assert part.n == 3
            assert (part.mean, part.variance, part.sd) == pytest.approx((mean, variance, sd), abs=0.51e-4)


def test_deviation_and_tolerance_as_in_tables_4_1_and_4_2() -> None:
    eps = Quantity(913.73, -15.5, u=91.373 / math.sqrt(3))  # +- 10 %
    sheet = real([859.8075 - 80, 859.8075 + 80], 1.0, eps).constants["a"].re.sheet
    assert sheet is not None
    assert sheet.percent == pytest.approx(-5.90, abs=0.005)
    assert (sheet.low, sheet.high) == pytest.approx((822.357, 1005.103))
    assert sheet.outside == ("S0",)


values = st.lists(st.floats(-100, 100), min_size=2, max_size=12).map(np.array)


@given(values)
def test_without_uncertainties_all_scatter_is_between_samples(x: np.ndarray) -> None:
    found = random_effects(x, np.zeros_like(x))
    n, s = x.size, float(np.std(x, ddof=1))
    assert found.tau == pytest.approx(s, rel=1e-9, abs=1e-12)
    assert found.mean == pytest.approx(float(np.mean(x)), rel=1e-9, abs=1e-12)
    assert found.u == pytest.approx(s / math.sqrt(n), rel=1e-9, abs=1e-12)
    limits = s * np.sqrt((n - 1) / special.chdtri(n - 1, [0.025, 0.975]))
    assert (found.tau_low, found.tau_high) == pytest.approx(tuple(limits), rel=1e-9, abs=1e-12)


@given(values, st.floats(1e-3, 1e3))
def test_equal_uncertainties_have_a_closed_form(x: np.ndarray, u: float) -> None:
    """tau^2 = s^2 - u^2, or 0; the mean is unweighted."""
    found = random_effects(x, np.full_like(x, u))
    tau2 = max(0.0, float(np.var(x, ddof=1)) - u**2)
    assert found.tau**2 == pytest.approx(tau2, rel=1e-6, abs=1e-9 * u**2)
    assert found.mean == pytest.approx(float(np.mean(x)), rel=1e-9, abs=1e-9)
    assert found.u == pytest.approx(math.sqrt((tau2 + u**2) / x.size), rel=1e-6)


@given(values, st.data())
def test_the_paule_mandel_condition_holds_for_any_uncertainties_and_units(x: np.ndarray, data: st.DataObject) -> None:
    u = np.array(data.draw(st.lists(st.floats(0.1, 50), min_size=x.size, max_size=x.size)))
    found, scaled = random_effects(x, u), random_effects(1e11 * x, 1e11 * u)
    weight = 1 / (u**2 + found.tau**2)
    q = float(np.sum(weight * (x - found.mean) ** 2))
    assert q == pytest.approx(x.size - 1, rel=1e-6) if found.tau > 0 else q <= x.size - 1 + 1e-9
    assert found.tau_low <= found.tau * (1 + 1e-9)
    assert found.tau <= found.tau_high * (1 + 1e-9)
    assert scaled.tau == pytest.approx(1e11 * found.tau, rel=1e-5, abs=1e-6 * 1e11 * float(np.max(u)))


def test_the_interval_of_tau_has_its_stated_coverage() -> None:
    rng = np.random.default_rng(7)
    u = np.array([0.2, 0.5, 1.0, 2.0])
    drawn = [random_effects(rng.normal(0, np.sqrt(1 + u**2)), u) for _ in range(400)]
    inside = sum(one.tau_low <= 1 <= one.tau_high for one in drawn)
    assert 364 <= inside <= 395  # 95 %, within 3.5 standard deviations of 400 draws


def test_outlier_test_is_grubbs_without_uncertainties() -> None:
    x, n = np.array([9.9, 10.0, 10.1, 10.05, 12.5]), 5
    g = abs(x[4] - x.mean()) / x.std(ddof=1)
    t = math.sqrt(g**2 * n * (n - 2) / ((n - 1) ** 2 - n * g**2))
    assert outliers(x, np.zeros(n)) == pytest.approx({4: n * 2 * float(special.stdtr(n - 2, -t))})


def test_a_second_outlier_does_not_hide_behind_the_first() -> None:
    x = np.array([10.0, 10.1, 9.9, 10.05, 9.95, 10.02, 9.97, 14.0, 14.1])
    assert outliers(x, np.zeros(9)).keys() == {7, 8}


def test_good_samples_are_rarely_called_outliers() -> None:
    rng = np.random.default_rng(11)
    alarms = sum(bool(outliers(rng.normal(0, 1, n), np.zeros(n))) for n in (3, 4, 6) for _ in range(300))
    assert alarms <= 20  # 9 expected of 900


def test_an_outlier_is_named_and_stays_in_the_table() -> None:
    part = real([1.0, 1.01, 0.99, 1.0, 1.02, 3.0], 0.01).constants["a"].re
    assert part.outliers.keys() == {"S5"}
    assert part.n == 6
    assert part.mean == pytest.approx(8.02 / 6)


def test_a_large_uncertainty_is_not_an_outlier() -> None:
    x, exact = np.array([1.0, 1.01, 0.99, 1.0, 1.02, 3.0]), np.full(6, 0.01)
    assert outliers(x, exact).keys() == {5}
    assert outliers(x, np.array([*exact[:5], 2.0])) == {}


def test_a_single_sample_has_no_scatter() -> None:
    found = real([1.0], 0.1)
    part = found.constants["a"].re
    assert (part.variance, part.sd, part.effects, part.within) == (None, None, None, pytest.approx(0.1))
    assert any("a single sample: there is no scatter" in sentence for sentence in found.says)


def test_without_uncertainties_no_scatter_is_separated_and_a_note_says_so() -> None:
    found = real([1.0, 2.0, 4.0], None)
    part = found.constants["a"].re
    assert part.within is None
    assert part.effects is None
    assert part.sd == pytest.approx(np.std([1, 2, 4], ddof=1))
    assert any("gives no uncertainties" in sentence for sentence in found.says)


def test_held_constants_are_omitted_with_a_note() -> None:
    held, fitted = Constant(2450.0, 0.0, 0.0, 0.0, "m/s", free=False), Constant(2.0, 0.1, 0.1, 0.0, "Pa")
    one, two = fit({"glue.c": held, "a": fitted}), fit({"glue.c": held, "a": replace(fitted, u_re=0.0)})
    found = population({"S1": one, "S2": two, "S3": one}, {})
    assert list(found.constants) == ["a"]
    assert [value.sample for value in found.constants["a"].re.values] == ["S1", "S3"]
    assert found.constants["a"].im is None
    assert "held or not determined, so not in the table: glue.c" in found.says
    assert "a: without S2, where it was held or not determined" in found.says


def test_equal_values_in_all_samples_count_as_held() -> None:
    fits = {f"S{k}": fit({"c": Constant(2450.0, 0, None, 0, "m/s")}) for k in range(3)}
    assert "held or not determined, so not in the table: c" in population(fits, {}).says


def test_fits_that_did_not_converge_are_excluded() -> None:
    good = fit({"a": Constant(1.0, 0, 0.1, 0, "Pa")})
    bad = replace(fit({"a": Constant(99.0, 0, 0.1, 0, "Pa")}), converged=False)
    found = population({"S1": good, "S2": bad, "S3": good}, {})
    assert found.samples == ("S1", "S3")
    assert found.constants["a"].re.mean == 1.0
    assert "left out, the fit did not converge: S2" in found.says
    assert population({"S2": bad}, {}).says[-1] == "no fit that can be used"
    baseline = replace(fit({"a": Constant(99.0, 0, None, 0, "Pa")}), converged=False)
    assert "taken, though the fit did not converge: S2" in population({"S2": baseline}, {}).says


def test_a_shared_uncertainty_is_detected_and_noted() -> None:
    found = real([7700.0, 7701.0, 7699.0, 7700.5, 7699.5], 75.0)
    assert any("a: the samples agree better than chance allows" in sentence for sentence in found.says)
    assert not any("agree better" in sentence for sentence in real([7700.0, 7750.0, 7600.0], 75.0).says)


def test_a_misfit_is_noted() -> None:
    good = fit({"a": Constant(1.0, 0, 0.1, 0, "Pa")})
    says = population({"S1": good, "S2": replace(good, chi2_per_dof=8.0)}, {}).says
    assert any(
        "the model does not describe S2 (chi2/dof > 1.5); its constants count like the others" in sentence
        for sentence in says
    )


@pytest.mark.parametrize("value", [Constant(math.inf, 0, 1.0, 0, "1"), Constant(1.0, 0, math.inf, 0, "1")])
def test_infinite_and_undetermined_values_are_omitted(value: Constant) -> None:
    assert population({"S1": fit({"Qm": value})}, {}).constants == {}
