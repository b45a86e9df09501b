"""The driver's overhead on a sweep, and its estimate compared with the sweep (`make bench`)."""

import time

import pytest

from pzctl.drivers import open_analyzer
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.server import SimOptions, running


def test_the_overhead_of_the_driver_on_a_sweep():
    with running() as sim:
        analyzer = open_analyzer(sim.resource)
        print()
        for points in (2, 201, 801, 8010):
            plan = SweepPlan((Segment(1e6, 6e6, points),))
            begun = time.perf_counter()
            for _ in range(5):
                analyzer.measure(plan)
            print(f"{points:5} points: {(time.perf_counter() - begun) / 5 * 1e3:.1f} ms around a sweep of no time")
        analyzer.close()


@pytest.mark.parametrize("bandwidth", [1, 3, 5])
def test_estimate_compared_with_the_sweep(bandwidth):
    scale = 0.02
    with running(SimOptions(port=0, bench_port=0, time_scale=scale)) as sim:
        analyzer = open_analyzer(sim.resource)
        plan = SweepPlan((Segment(1e6, 6e6, 801),), bandwidth=bandwidth)
        estimate = analyzer.estimated_seconds(plan)
        (sweep,) = analyzer.measure(plan)
        analyzer.close()
    taken = sweep.settings["sweep_seconds"] / scale
    print(f"\nbandwidth {bandwidth}: {1e3 * taken / 801:.2f} ms a point, {1e3 * estimate / 801:.2f} ms by the model")
