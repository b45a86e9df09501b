"""The joint diagnosis of many samples: shared effects, effects of single samples, and the scatter of constants."""

import contextlib
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from ...models.build import Build, EffectSpec, Quantity
from ...models.effects import catalogue
from ...models.stack import Stack
from ..diagnosis.diagnose import diagnose
from ..diagnosis.findings import Diagnosis, Finding
from ..diagnosis.hypotheses.bench_effects import BenchEffect
from ..diagnosis.hypotheses.held_out import BANDS
from ..diagnosis.hypotheses.instrument_artefacts import UNKNOWN
from ..engine.on_cores import available_cores
from ..engine.parameters.assembly import stack_of
from ..interface import FitError
from .batch import BatchJob, Failure, results_of
from .exact_bench import exact_bench
from .population_statistics import Population, spreads
from .process_pool import process_pool
from .sample_equations import Knobs, SampleEquations, bench_effects, ends_of, sample_equations
from .shared_bench import SharedBench
from .shared_effects import shared_bench

_FEWEST = 2
"""Fewest samples that can share an effect."""


class TooFewSamplesError(FitError):
    """Fewer than two samples can be diagnosed."""


class _LostError(Exception):
    """A sample cannot be fitted with these shared effects."""


@dataclass(frozen=True)
class Recurring:
    """A finding of several samples with a different size in each."""

    effect: str
    where: str
    samples: tuple[str, ...]
    sizes: Mapping[str, tuple[float, ...]]
    """Values of each parameter, in the order of the samples."""


@dataclass(frozen=True, eq=False)
class JointDiagnosis:
    """Result of the diagnosis of many samples."""

    samples: tuple[str, ...]
    shared: SharedBench
    own: Mapping[str, Diagnosis]
    """Diagnosis of each sample in addition to the shared effects."""
    recurring: tuple[Recurring, ...]
    population: Population
    failed: Mapping[str, str]
    """Reason why a sample has no diagnosis or is not part of the joint one."""
    seconds: float

    def effects_of(self, sample: str) -> tuple[EffectSpec, ...]:
        """Return what a sample has, shared effects first, as its build may state it."""
        return (*self.shared.stated, *self.own[sample].effects)


@dataclass(frozen=True)
class HowToDiagnose:
    """What the diagnosis of each sample is asked for; see `diagnose`."""

    effects: tuple[str, ...] | None = None
    hold_out: str = BANDS
    learn: bool = False


@dataclass(frozen=True, eq=False)
class _Survey:
    """Task for one sample: its equations on a bench with these effects."""

    job: BatchJob
    ends: tuple[float, float]
    knobs: Knobs
    known: tuple[BenchEffect, ...]


@dataclass(frozen=True, eq=False)
class _Own:
    """Task for one sample: its own diagnosis on a bench with these effects."""

    job: BatchJob
    how: HowToDiagnose
    known: tuple[BenchEffect, ...]


def _surveyed(asked: _Survey) -> SampleEquations:
    return sample_equations(asked.job.sample, asked.job.task, asked.ends, asked.knobs, asked.known)


def _own(asked: _Own) -> Diagnosis:
    how = asked.how
    return diagnose(asked.job.task, how.effects, hold_out=how.hold_out, learn=how.learn, known=asked.known)


def diagnose_together(
    jobs: Sequence[BatchJob],
    sheets: Mapping[str, Quantity],
    how: HowToDiagnose = HowToDiagnose(),
    client: Any = None,
    progress: Callable[[str], None] = lambda _: None,
    processes: int | None = None,
) -> JointDiagnosis:
    """Diagnose samples that were measured on the same bench.

    `client`: of a Dask cluster, as from `on_dask`; None for so many
    `processes` of this machine (None: one on each core). Raises TooFewSamplesError if fewer than two samples can be
    fitted.
    """
    if len(jobs) < _FEWEST:
        raise TooFewSamplesError(f"{len(jobs)} samples: two or more are needed to tell what they share")
    if client is not None:
        return _diagnosed(jobs, sheets, how, client, progress)
    with process_pool(min(len(jobs), processes or available_cores())) as pool:
        return _diagnosed(jobs, sheets, how, pool, progress)


def _diagnosed(
    jobs: Sequence[BatchJob],
    sheets: Mapping[str, Quantity],
    how: HowToDiagnose,
    workers: Any,
    progress: Callable[[str], None],
) -> JointDiagnosis:
    began = time.perf_counter()
    failed: dict[str, str] = {}
    fit = list(jobs)
    builds = [job.task.build for job in jobs if job.task.build is not None]
    if not builds:
        raise TooFewSamplesError("no sample has a build file")
    ends, knobs = ends_of([job.task for job in fit]), bench_effects(_last_stack(builds[0]), how.effects)
    odds = {one.name: one.odds for one in catalogue()}

    def survey(known: tuple[BenchEffect, ...]) -> list[SampleEquations]:
        progress(f"{len(fit)} samples with {', '.join(one.name for one in known) or 'nothing'} in common")
        found = results_of(_surveyed, [_Survey(job, ends, knobs, known) for job in fit], workers)
        lost = {job.sample: one.says for job, one in zip(fit, found, strict=True) if isinstance(one, Failure)}
        if lost:
            failed.update(lost)
            fit[:] = [job for job in fit if job.sample not in lost]
            raise _LostError
        return [one for one in found if not isinstance(one, Failure)]

    alone = _exact_alone(fit, replace(how, learn=False), workers, progress)
    bench = exact_bench(alone, knobs)
    while bench is None:
        if len(fit) < _FEWEST:
            raise TooFewSamplesError(f"fewer than two samples can be fitted: {'; '.join(failed.values())}")
        with contextlib.suppress(_LostError):  # evidences of different sets of samples cannot be compared: start again
            bench = shared_bench(survey, knobs, ends, odds)
    own = {} if bench.known or how.learn else alone
    asked = [_Own(job, how, bench.known) for job in fit if job.sample not in own]
    progress(f"diagnosing {len(asked)} samples")
    told = results_of(_own, asked, workers, lambda k, _: progress(f"{asked[k].job.sample} is diagnosed"))
    for one, answer in zip(asked, told, strict=True):
        if isinstance(answer, Failure):
            failed[one.job.sample] = answer.says
        else:
            own[one.job.sample] = answer
    constants, says = spreads({sample: one.final.constants for sample, one in own.items()}, sheets)
    population = Population(tuple(own), constants, tuple(says))
    samples = tuple(job.sample for job in jobs)
    return JointDiagnosis(samples, bench, own, _recurring(own), population, failed, time.perf_counter() - began)


def _exact_alone(
    jobs: Sequence[BatchJob], how: HowToDiagnose, workers: Any, progress: Callable[[str], None]
) -> dict[str, Diagnosis]:
    """Return the diagnosis of each sample alone if none of them needs an error but white noise; else nothing.

    Two samples tell whether it is worth diagnosing the others.
    """
    found: dict[str, Diagnosis] = {}
    for some in filter(None, (jobs[:_FEWEST], jobs[_FEWEST:])):
        progress(f"looking for errors of the analyzer in {', '.join(job.sample for job in some)}")
        told = results_of(_own, [_Own(job, how, ()) for job in some], workers)
        own = {job.sample: one for job, one in zip(some, told, strict=True) if isinstance(one, Diagnosis) and one.exact}
        if len(own) < len(some):
            return {}
        found |= own
    return found


def _last_stack(build: Build) -> Stack:
    return stack_of(build, build.steps[-1])


def _recurring(own: Mapping[str, Diagnosis]) -> tuple[Recurring, ...]:
    """Return the findings common to two or more samples, the most frequent first."""
    found: dict[tuple[str, str], dict[str, Finding]] = {}
    for sample, one in own.items():
        for finding in one.findings:
            if finding.effect != UNKNOWN:
                found.setdefault((finding.effect, finding.where), {})[sample] = finding
    told = [
        Recurring(effect, where, tuple(by), _sizes(list(by.values())))
        for (effect, where), by in found.items()
        if len(by) >= _FEWEST
    ]
    return tuple(sorted(told, key=lambda one: -len(one.samples)))


def _sizes(findings: Sequence[Finding]) -> dict[str, tuple[float, ...]]:
    names = [name for name in findings[0].parameters if all(name in one.parameters for one in findings)]
    return {name: tuple(one.parameters[name].value for one in findings) for name in names}
