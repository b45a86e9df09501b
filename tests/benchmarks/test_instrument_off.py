"""A perfect disk on the simulated bench, by an analyzer that errs within its specification: nothing is named."""

from collections.abc import Iterator
from contextlib import closing

import numpy as np

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.drivers import open_analyzer
from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.findings import Diagnosis
from pzctl.fitters.interface import FitTask
from pzctl.sim.bench.bench_control import bench_command
from pzctl.sim.bench.sample import sample
from pzctl.sim.server import SimOptions, running

BUILD = read_build(THESIS_BUILD)
SEEDS = range(1, 9)


def told(seed: int) -> Diagnosis:
    """Return the diagnosis of the disk that this seed puts on the bench, and whose analyzer it makes."""
    with (
        running(SimOptions(port=0, bench_port=0, time_scale=0.0, seed=seed, off=True)) as sim,
        closing(open_analyzer(sim.resource)) as analyzer,
    ):
        bench_command("127.0.0.1", sim.bench_port, command="step", name="disk")
        return diagnose(FitTask(BUILD, {"disk": analyzer.measure(BUILD.plan)}))


def deviations(seed: int, diagnosis: Diagnosis) -> Iterator[float]:
    """Yield the error of each part of each constant of the disk, in its standard uncertainties."""
    truth = sample(seed).truth()
    for name in ("disk.c33D", "disk.h33", "disk.eps33S"):
        own, true = diagnosis.final.constants[name], truth[name]
        yield from ((own.re - float(true["re"])) / own.u_re, (own.im - float(true["im"])) / own.u_im)


def test_an_analyzer_off_within_its_specification_is_no_mismatch() -> None:
    made = {seed: told(seed) for seed in SEEDS}
    away = {seed: list(deviations(seed, one)) for seed, one in made.items()}
    for seed, one in made.items():
        said = ", ".join(f"{finding.effect} {finding.probability:.2f}" for finding in one.findings)
        print(f"seed {seed}: {one.verdict}, {said or 'nothing'}; largest {np.max(np.abs(away[seed])):.1f} u")
    assert [one.verdict for one in made.values()] == ["no-mismatch"] * len(SEEDS)
    within = float(np.mean(np.abs(np.concatenate(list(away.values()))) < 2))
    print(f"{100 * within:.0f} % of the constants' parts within 2 u")
