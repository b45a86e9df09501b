"""Sweeps that a diagnosis proposes on the simulated bench decide what one sweep leaves open."""

from contextlib import closing
from dataclasses import replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.drivers import open_analyzer
from pzctl.drivers.agilent4294a.capabilities import CAPABILITIES
from pzctl.fitters.diagnosis.design.experiment_design import proposals
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.interface import FitTask
from pzctl.models.sweep_plan import Segment, SweepPlan
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.server import SimOptions, running

BUILD = read_build(THESIS_BUILD)
NOISE = 5e-5
INSTRUMENT = replace(CAPABILITIES, noise=lambda plan, f, Z: np.full(f.size, NOISE))
STILL = ("stray-capacitance", "electrode-mass")
OF_THE_SWEEP = ("drive-nonlinearity", "sweep-lag", "temperature-drift")


@pytest.mark.parametrize(
    ("hidden", "size", "kind", "parameter", "value"),
    [
        ("drive-nonlinearity", 60.0, "level", "softening", 60.0),
        ("sweep-lag", 8e-3, "", "lag", 8e-3 * 2e6 / (80 * 0.16)),
        ("temperature-drift", 1e-3, "", "relative", None),
    ],
)
def test_proposed_sweeps_decide_what_one_sweep_leaves_open(
    hidden: str, size: float, kind: str, parameter: str, value: float | None
) -> None:
    """The first sweep shows it only by its shape, if at all."""
    plan = SweepPlan((Segment(3e6, 5e6, 81),), oscillator_V=0.5, bandwidth=5)
    options = SimOptions(port=0, bench_port=0, time_scale=0.0, jig="ideal", hidden={hidden: size})
    considered = (*OF_THE_SWEEP, "electrode-mass") if hidden != "drive-nonlinearity" else OF_THE_SWEEP[:2]
    with running(options) as sim, closing(open_analyzer(sim.resource)) as analyzer:
        bench_command("127.0.0.1", sim.bench_port, command="step", name="disk")
        own = analyzer.measure(plan)
        task = FitTask(BUILD, {"disk": own})
        first = diagnose(task, considered)
        asked = [one.experiment for one in proposals(task, first, INSTRUMENT)]
        further = [sweep for one in asked for sweep in analyzer.measure(one.plan)]
    assert any(kind in one.kind for one in asked)
    decided = diagnose(replace(task, sweeps={"disk": (*own, *further)}), considered)
    (finding,) = decided.findings
    assert (decided.verdict, finding.effect) == ("explained", hidden)
    assert not [one for one in finding.alternatives if one.probability > 0.1]
    found = finding.parameters[parameter]
    assert value is None or abs(found.value - value) < max(5 * found.u, 0.03 * value)


def test_a_wider_sweep_distinguishes_a_lead_from_a_cable() -> None:
    options = SimOptions(port=0, bench_port=0, time_scale=0.0, jig="ideal", hidden={"lead-inductance": 3e-9})
    considered = ("lead-inductance", "cable", "series-resistance", *STILL)
    with running(options) as sim, closing(open_analyzer(sim.resource)) as analyzer:
        bench_command("127.0.0.1", sim.bench_port, command="step", name="disk")
        own, further = (
            analyzer.measure(SweepPlan((Segment(low, high, 61),), oscillator_V=0.5, bandwidth=5))
            for low, high in ((3.5e6, 4.5e6), (1.5e6, 9e6))
        )
    (first,) = diagnose(FitTask(BUILD, {"disk": own}), considered).findings
    assert max(one.probability for one in (*first.alternatives, *first.same_as)) > 0.05
    (finding,) = diagnose(FitTask(BUILD, {"disk": (*own, *further)}), considered).findings
    others = {one.effect for one in (*finding.alternatives, *finding.same_as) if one.probability > 0.01}
    assert finding.effect == "lead-inductance"
    assert others <= {"cable"}, "a short cable is an inductance"
    assert not [one for one in finding.alternatives if one.probability > 0.05]
