"""Adaptive plans: 20 points per linewidth at resonances, within the given time, as one recording."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pzctl.drivers import open_analyzer
from pzctl.drivers.agilent4294a.capabilities import CAPABILITIES
from pzctl.drivers.agilent4294a.sweeps import grid
from pzctl.drivers.planning.adaptive import AdaptiveError, adapted, adaptive_plan, look_plan
from pzctl.drivers.planning.resonances import Resonance, resonances
from pzctl.models.sweep import Sweep
from pzctl.models.sweep_plan import PlanError, Segment, SweepPlan
from pzctl.sim.server import SimOptions, running

BASE = SweepPlan((Segment(50e3, 8e6, 801),))
BASE_SECONDS = 128.2
"""801 points at bandwidth 5."""


def axis(plan):
    return np.concatenate([grid.points(segment) for segment in plan.segments])


def resonator(f, q, f0=1e6, c0=1e-9, k2=0.1):
    """Impedance of a capacitor with one resonance at f0, lossless except for its Q."""
    x = f / f0
    return 1 / (2j * np.pi * f * c0 * (1 + k2 / (1 - x**2 + 1j * x / q)))


def looking_at(q, seen):
    def measure(plan):
        seen.append(plan)
        return tuple(Sweep(f := grid.points(s), resonator(f, q)) for s in plan.segments)

    return measure


@pytest.mark.parametrize("q", [50, 1000, 5000])
def test_a_narrow_resonance_is_resolved_by_a_second_preliminary_sweep(q):
    plans = []
    found = adapted(BASE, BASE_SECONDS, looking_at(q, plans), CAPABILITIES)
    assert (len(plans) > 1) == (q >= 1000)
    series, parallel = found.resonances
    assert series.frequency == pytest.approx(1e6, rel=0.2 / q)
    assert parallel.frequency == pytest.approx(1e6 * np.sqrt(1.1), rel=0.2 / q)
    assert series.linewidth == pytest.approx(1e6 / q, rel=0.1)
    assert all(plan.bandwidth == 1 for plan in plans)
    assert found.plan.joined


@settings(max_examples=30, deadline=None)
@given(
    st.lists(
        st.builds(
            Resonance,
            st.floats(60e3, 7e6),
            st.floats(200.0, 50e3),
            st.floats(0.02, 1.0),
            st.just(50.0),
        ),
        min_size=1,
        max_size=12,
    ),
    st.floats(60.0, 600.0),
)
def test_every_chosen_resonance_has_its_points_within_the_time(seen, seconds):
    plan, kept = adaptive_plan(BASE, seen, seconds, CAPABILITIES)
    f = axis(plan)
    assert np.all(np.diff(f) > 0)
    assert f[0] == 50e3
    assert f[-1] == 8e6
    assert np.sum(24.8 / f + 0.16) + 0.5 * len(plan.segments) <= seconds
    for one in kept:
        core = np.diff(f[(f > one.frequency - one.linewidth) & (f < one.frequency + one.linewidth)])
        assert core.max() <= one.linewidth / 20 * (1 + 1e-6) + 2e-3
    weakest = min(one.strength for one in kept)
    assert all(one.strength <= weakest for one in seen if one not in kept), "a weaker one was kept instead"
    assert np.max(np.diff(f) / f[:-1]) < 0.1, "no gap in the background"


def test_a_segment_saves_more_time_than_its_set_up_costs():
    one = Resonance(1e6, 1e4, 0.9, 100.0)
    precise, _ = adaptive_plan(BASE, [one], 60.0, CAPABILITIES)
    fast, _ = adaptive_plan(replace(BASE, bandwidth=1), [one], 5.0, CAPABILITIES)
    assert len(fast.segments) < len(precise.segments)
    patient, _ = adaptive_plan(replace(BASE, sweep_delay_s=5.0), [one], 120.0, CAPABILITIES)
    assert CAPABILITIES.seconds(patient) <= 120.0
    assert len(patient.segments) < len(precise.segments)


def test_no_resonance_and_no_time_are_said():
    with pytest.raises(AdaptiveError, match="no resonance between 50 and 8000 kHz"):
        adaptive_plan(BASE, (), 100.0, CAPABILITIES)
    one = Resonance(1e6, 1e4, 0.9, 100.0)
    with pytest.raises(AdaptiveError, match="10 s are left, but a single resonance"):
        adaptive_plan(BASE, [one], 10.0, CAPABILITIES)


def test_an_inverted_device_is_said_to_be_one():
    def measure(plan):
        return tuple(Sweep(f := grid.points(s), -resonator(f, 50)) for s in plan.segments)

    with pytest.raises(AdaptiveError, match="polarity of the leads"):
        adapted(BASE, BASE_SECONDS, measure, CAPABILITIES)


def test_noise_of_a_bare_capacitor_is_not_a_resonance():
    f = grid.points(look_plan(BASE, CAPABILITIES).segments[0])
    rng = np.random.default_rng(1)
    noise = 2e-4 * (rng.standard_normal(f.size) + 1j * rng.standard_normal(f.size))
    assert resonances((Sweep(f, np.exp(noise) / (2j * np.pi * f * 1e-9 * (1 - 0.002j))),)) == ()


def test_at_the_lowest_level_noise_is_not_mistaken_for_resonances():
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, radial=True)) as sim:
        analyzer = open_analyzer(sim.resource)
        loud, quiet = (
            [
                one.frequency
                for one in resonances(analyzer.measure(look_plan(replace(BASE, oscillator_V=volts), CAPABILITIES)))
            ]
            for volts in (0.5, 0.005)
        )
        analyzer.close()
    assert 4 <= len(quiet) < len(loud)
    assert all(min(abs(f / other - 1) for other in loud) < 0.01 for f in quiet)


def test_segments_that_are_joined_must_rise():
    with pytest.raises(PlanError, match="segment 2 starts at 1000000 Hz and the one before stops at 2000000 Hz"):
        SweepPlan((Segment(0.5e6, 2e6, 11), Segment(1e6, 3e6, 11)), joined=True)


def test_a_joined_plan_gives_one_recording():
    with running(SimOptions(port=0, bench_port=0, time_scale=0.0, radial=True)) as sim:
        analyzer = open_analyzer(sim.resource)
        found = adapted(BASE, BASE_SECONDS, analyzer.measure, CAPABILITIES)
        (sweep,) = analyzer.measure(found.plan)
        apart = analyzer.measure(replace(found.plan, joined=False))
        analyzer.close()
    there = np.concatenate([part.frequency for part in apart])
    np.testing.assert_allclose(
        sweep.frequency, there, rtol=0, atol=1.01e-3
    )  # a line of the list ends on the 1 mHz grid
    assert sweep.settings["points"] == len(sweep.settings["noise_relative"]) == sweep.frequency.size
    assert len(sweep.settings["segments"]) == len(found.plan.segments)
    assert any("inductive" in note for part in apart for note in part.notes)
    assert not any("inductive" in note for note in sweep.notes)
    radial = [one for one in found.resonances if 120e3 < one.frequency < 160e3]
    thickness = [one for one in found.resonances if 3.5e6 < one.frequency < 5e6]
    assert len(radial) == len(thickness) == 2
