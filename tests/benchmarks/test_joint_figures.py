"""The joint diagnosis of many samples compared with single ones, on simulated laboratories (`make bench`)."""

from collections.abc import Sequence

import numpy as np
import pytest
from shared_world import laboratory, true_inductance

from pzctl.fitters.diagnosis.hypotheses.bench_effects import BenchEffect
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.population.batch import BatchJob
from pzctl.fitters.population.sample_equations import SampleEquations, bench_effects, ends_of, sample_equations
from pzctl.fitters.population.shared_bench import SharedBench
from pzctl.fitters.population.shared_effects import shared_bench
from pzctl.models.effects import catalogue

COUNT = 12


def together(jobs: Sequence[BatchJob]) -> SharedBench:
    """The shared effects of these samples."""
    build = jobs[0].task.build
    assert build is not None
    ends, knobs = ends_of([job.task for job in jobs]), bench_effects(stack_of(build, build.steps[-1]))

    def survey(known: tuple[BenchEffect, ...]) -> list[SampleEquations]:
        return [sample_equations(job.sample, job.task, ends, knobs, known) for job in jobs]

    return shared_bench(survey, knobs, ends, {one.name: one.odds for one in catalogue()})


def told(seed: int, inductance: float, own: float = 0.0) -> tuple[SharedBench, SharedBench]:
    """The shared effects of twelve samples, and those of the first one with itself."""
    jobs = [BatchJob(name, task) for name, task in laboratory(seed, COUNT, inductance, own).items()]
    return together(jobs), together(jobs[:1])


def inductance_of(bench: SharedBench) -> tuple[float, float]:
    """Series inductance of effects and fixture together, and its uncertainty if it is due to one of them."""
    parts = [one.parameters["inductance"] for one in bench.effects if "inductance" in one.parameters]
    residue = bench.fixture.get("inductance")
    parts += [residue] if residue is not None else []
    return sum(one.value for one in parts), min((one.u for one in parts), default=float("nan"))


@pytest.mark.parametrize("inductance", [0.0, 3e-9, 6e-9, 12e-9])
def test_a_lead_in_twelve_samples(inductance: float) -> None:
    errors: list[float] = []
    for seed in range(4):
        all_of_them, alone = told(seed, inductance)
        true = true_inductance(seed, inductance)
        (value, u), (value1, u1) = inductance_of(all_of_them), inductance_of(alone)
        names = [f"{one.effect} {one.probability:.2f}" for one in all_of_them.effects]
        seen = [
            f"{name} {part.probability:.2f}" for name, part in all_of_them.fixture.items() if part.probability > 0.5
        ]
        names1 = [f"{one.effect} {one.probability:.2f}" for one in alone.effects]
        print(
            f"\nlead {1e9 * inductance:.0f} nH, with the fixture's residue {1e9 * true:.2f}, seed {seed}: "
            f"12 samples {1e9 * value:.2f}({1e9 * u:.2f}) nH {names} fixture {seen}; "
            f"one sample {1e9 * value1:.2f}({1e9 * u1:.2f}) nH {names1}",
            flush=True,
        )
        errors.append(value - true)
    assert float(np.median(np.abs(errors))) < 4e-10
