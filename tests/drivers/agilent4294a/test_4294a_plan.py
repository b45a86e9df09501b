"""Impossible plans are refused before anything is sent; long segments become several sweeps of one grid."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from pzctl.drivers.agilent4294a import limits
from pzctl.drivers.agilent4294a.sweeps import grid
from pzctl.drivers.agilent4294a.sweeps.stitch import stitch
from pzctl.models.sweep_plan import PlanError, Segment, SweepPlan

FINE = Segment(1e6, 6e6)


@pytest.mark.parametrize(
    ("plan", "words"),
    [
        (SweepPlan((Segment(39.9, 1e6),)), r"start is 39\.9 Hz; the 4294A can do 40 to 110000000 Hz"),
        (SweepPlan((FINE, Segment(1e6, 140e6))), r"segment 2: stop is 140000000 Hz; .* 40 to 110000000 Hz"),
        (SweepPlan((Segment(109.9999e6, 110e6, 3, "log"),)), r"start is 109999900 Hz; .* 40 to 109999800 Hz"),
        (SweepPlan((Segment(41, 59, 3, "log"),)), r"stop is 59 Hz; the 4294A can do 60 to"),
        (SweepPlan((Segment(1e6, 1000000.5, 801),)), r"0\.000625 Hz apart; at least 0\.002 Hz"),
        (SweepPlan((FINE,), oscillator_V=1.5), r"oscillator is 1\.5 V; the 4294A can do 0\.005 to 1 V"),
        (SweepPlan((FINE,), oscillator_V=float("nan")), "oscillator is nan V"),
        (SweepPlan((FINE,), oscillator_A=0.1), r"oscillator is 0\.1 A; the 4294A can do 0\.0002 to 0\.02 A"),
        (SweepPlan((FINE,), point_delay_s=31), r"point delay is 31 s; the 4294A can do 0 to 30 s"),
        (SweepPlan((FINE,), bandwidth=6), r"bandwidth is 6; the 4294A can do 1 to 5"),
        (SweepPlan((FINE,), point_average=0), "point averaging is 0; the 4294A can do 1 to 256"),
        (SweepPlan((FINE,), sweep_average=257), "sweep averaging is 257; the 4294A can do 1 to 256"),
        (SweepPlan((FINE,), bias_V=-41), r"bias is -41 V; the 4294A can do -40 to 40 V"),
    ],
)
def test_the_plan_is_refused_in_one_sentence(plan, words):
    with pytest.raises(PlanError, match=words):
        limits.check(plan)


segments = st.builds(
    Segment,
    st.floats(100, 1e6),
    st.floats(2e6, 110e6),
    st.integers(2, 5000),
    st.sampled_from(["linear", "log"]),
)


@given(segments)
def test_parts_cover_the_segment_on_its_grid(segment):
    limits.check(SweepPlan((segment,)))
    whole, parts = grid.points(segment), grid.parts(segment)

    assert (parts[0].first, parts[-1].last) == (0, segment.points - 1)
    for part in parts:
        swept = grid.points(grid.of_part(part))
        assert len(swept) <= 801
        np.testing.assert_allclose(swept, whole[part.first : part.last + 1], rtol=1e-3 / swept[0], atol=2e-3)
    for one, other in pairwise(parts):
        assert one.last - other.first == grid.OVERLAP_POINTS - 1


def test_a_log_grid_is_that_of_a_real_export():
    # first lines of a 4294A's own file: 801 points LOG, 74 to 316.4 kHz rounded to 1 mHz
    f = grid.points(Segment(74e3, 316.4e3, 601, "log"))
    assert (f[0], f[-1]) == (74e3, 316.4e3)
    np.testing.assert_array_equal(f, np.round(f, 3))


def test_overlaps_give_noise_and_drift():
    rng = np.random.default_rng(20)
    segment = Segment(1e6, 2e6, 20_000)
    f, sigma, step = grid.points(segment), 3e-4, 0.002
    clean = 100 - 1e8j / f
    cuts = []
    for k, part in enumerate(grid.parts(segment)):
        z = clean[part.first : part.last + 1] * (1 + step) ** k
        noise = sigma * (rng.standard_normal(z.size) + 1j * rng.standard_normal(z.size))
        cuts.append((f[part.first : part.last + 1], z * (1 + noise)))

    whole = stitch(cuts)

    np.testing.assert_array_equal(whole.frequency, f)
    assert whole.noise == pytest.approx(sigma, rel=0.1)
    assert np.mean(whole.drift) == pytest.approx(np.log(1 + step), abs=6 * sigma / np.sqrt(16 * len(whole.drift)))


def test_a_single_sweep_gives_no_noise_estimate():
    f = grid.points(FINE)
    assert stitch([(f, 1e3 / f * 1j)]).noise is None
