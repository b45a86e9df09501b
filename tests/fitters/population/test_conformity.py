"""Verdicts with a guard band, and control charts, which a test engineer relies on to release a lot."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import BuildError, build_from_json, build_to_json, parse_build
from pzctl.fitters.interface import Constant, FitResult, Noise
from pzctl.fitters.population.conformity import judged
from pzctl.fitters.population.control_chart import ChartError, ChartValue, control_chart
from pzctl.models.specification import Limit

BUILD = """
name = "S4"
diameter_mm = 16.0
layers = [{ name = "disk", kind = "piezo", material = "Pz27", thickness_mm = 0.5 }]
load = { back = "air", front = "air" }
steps = [{ name = "disk", layers = ["disk"] }]
"""
LIMITS = "[limits.disk]\nc33D_GPa = { min = 146, max = 156 }\nkt = { min = 0.45 }\n"


def fitted(**constants: Constant) -> FitResult:
    named = {f"disk.{name}": constant for name, constant in constants.items()}
    return FitResult("S4", "mason", "1", ("disk",), Noise(1e-3, "repeats"), 1.0, named, {}, (), 0.01, True, 1, 0.1)


@pytest.mark.parametrize(
    ("c33D", "u", "verdict"),
    [
        (148e9, 1e9, "pass"),
        (147.6e9, 1e9, "undecided"),
        (146.1e9, 1e9, "undecided"),
        (145.9e9, 1e9, "undecided"),
        (144.3e9, 1e9, "fail"),
        (157.8e9, 1e9, "fail"),
        (151e9, 4e9, "undecided"),
        (151e9, 2e9, "pass"),
    ],
)
def test_a_value_passes_only_inside_the_guard_band(c33D: float, u: float, verdict: str) -> None:
    """ISO 14253-1:2017: 95 %, so 1.645 u from a single limit."""
    build = parse_build(BUILD + LIMITS.splitlines()[0] + "\nc33D_GPa = { min = 146, max = 156 }")
    found = judged(fitted(c33D=Constant(c33D, 0, u, 0, "Pa")), build)
    assert found is not None
    assert found.verdict == verdict
    assert found.limits[0].guard == pytest.approx(1.645 * u, rel=1e-3)


def test_the_worst_verdict_decides_and_unmeasured_limits_never_pass() -> None:
    build = parse_build(BUILD + LIMITS)
    good, kt = Constant(151e9, 0, 1e9, 0, "Pa"), Constant(0.47, 0, 0.001, 0, "1")

    def whole(result: FitResult) -> str:
        verdict = judged(result, build)
        assert verdict is not None
        return verdict.verdict

    assert whole(fitted(c33D=good, kt=kt)) == "pass"
    assert whole(fitted(c33D=good, kt=replace(kt, re=0.44))) == "fail"
    assert whole(fitted(c33D=good)) == "undecided"
    assert whole(fitted(c33D=replace(good, u_re=0.0, free=False), kt=kt)) == "undecided"
    assert whole(fitted(c33D=replace(good, u_re=None), kt=kt)) == "undecided"
    assert whole(replace(fitted(c33D=good, kt=kt), converged=False)) == "undecided"
    assert judged(replace(fitted(kt=kt), steps=()), build) is None, "the layer was not there yet"
    assert judged(fitted(kt=kt), parse_build(BUILD)) is None


def test_limits_in_a_build_survive_the_journal() -> None:
    build = parse_build(BUILD + "[limits]\nconformance = 0.9\n" + LIMITS)
    assert build.specification is not None
    assert build.specification.limits["disk.c33D"] == Limit(146e9, 156e9)
    assert build_from_json(build_to_json(build)) == build


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("[limits.disc]\nkt = { min = 0.4 }", "build.toml: limits.disc: the build has no such layer; it has disk"),
        ("[limits.disk]\nc33D = { min = 1 }", "limits.disk.c33D is not a known key; did you mean c33D_Pa?"),
        ("[limits.disk]\nkt = { min = 0.6, max = 0.5 }", "limits.disk.kt has limits: min 0.6 is not below max 0.5"),
        ("[limits.disk]\nkt = {}", "limits.disk.kt has no min or max; write kt = { min = ..., max = ... }"),
        ("[limits]\nconformance = 95\n[limits.disk]\nkt = { min = 0.4 }", "conformance is 95; 0.5 (no guard band) to"),
        ("[limits]", "limits has no limit; write a table such as [limits.disk]"),
    ],
)
def test_wrong_limits_are_one_sentence(text: str, sentence: str) -> None:
    with pytest.raises(BuildError) as error:
        parse_build(BUILD + text)
    assert sentence in str(error.value)


def values(x: "list[float] | np.ndarray[tuple[int], np.dtype[np.float64]]") -> list[ChartValue]:
    return [ChartValue(f"S{k}", f"2026-01-{k + 1:02}", float(v), 0.1) for k, v in enumerate(x)]


def test_charts_name_the_outlying_sample_and_the_rule() -> None:
    x = np.random.default_rng(7).normal(100.0, 1.0, 25)
    quiet = control_chart(values(x))
    assert quiet.left == ()
    assert quiet.sigma == pytest.approx(float(np.mean(np.abs(np.diff(x)))) / 1.128)
    jump = x.copy()
    jump[17] += 8
    left = control_chart(values(jump), baseline=15).left[0]
    assert left.sample == "S17"
    assert "above the 3 sigma limit" in left.signals
    shifted = np.concatenate([x, x[:15] + 1.2])
    chart = control_chart(values(shifted), baseline=25)
    assert any("lasting shift up (EWMA)" in point.signals for point in chart.left)
    assert not any("sigma" in signal for point in chart.left[:1] for signal in point.signals), "EWMA is first"
    trend = control_chart(values([*x[:10], 99.5, 99.8, 100.1, 100.4, 100.7, 101.0]), baseline=10)
    assert "6 samples in a row rising" in trend.points[-1].signals


def test_an_ewma_chart_in_control_gives_a_false_alarm_in_about_500_samples() -> None:
    """The mean run length of ISO 7870-6; without a restart the alarms come in bursts, which count once."""
    chart = control_chart(values(np.random.default_rng(5).normal(0, 1, 20_000)))
    alarms = np.array([any("EWMA" in signal for signal in point.signals) for point in chart.points])
    bursts = sum(1 for k in np.flatnonzero(alarms) if not alarms[max(0, k - 10) : k].any())
    assert 20 < bursts < 80


def test_capability_equals_the_textbook_value() -> None:
    x = np.random.default_rng(1).normal(10.0, 0.1, 400)
    capable = control_chart(values(x), limit=Limit(9.5, 10.4)).capability
    assert capable is not None
    assert capable.cp == pytest.approx(0.9 / 0.6, rel=0.1)
    assert capable.cpk == pytest.approx(0.4 / 0.3, rel=0.1)
    assert capable.ppk == pytest.approx((10.4 - x.mean()) / (3 * x.std(ddof=1)))
    assert capable.cpk_low < capable.cpk
    outside = control_chart(values(x), limit=Limit(low=10.5)).capability
    assert outside is not None
    assert outside.cpk < 0
    assert outside.cp is None


def test_a_chart_that_cannot_be_made_is_one_sentence() -> None:
    with pytest.raises(ChartError, match="2 sample\\(s\\) to set the control limits by; at least 3"):
        control_chart(values([1.0, 2.0]))
    with pytest.raises(ChartError, match="all samples have the same value"):
        control_chart(values([1.0, 1.0, 1.0]))
