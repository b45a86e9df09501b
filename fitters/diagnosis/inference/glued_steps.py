"""The glued steps of a disk of finite diameter: their model, and the diagnoses of disk and glued steps as one."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ....models.build import EffectSpec, Quantity
from ....models.stack import Stack
from ...engine.covariance import posterior
from ...engine.parameters.assembly import stack_of
from ...engine.recording import Recording
from ...interface import Curve, FitTask
from ...layered.two_d.glued_on_disk import KnownDisk, glued_on
from ...layered.two_d.stack_under_diagnosis import StackUnderDiagnosis
from ...uncertainty.fit_result import curves_of
from ..findings import Diagnosis, FitSummary, Verdict
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem
from ..search.refit import as_refit
from .finite_diameter import DiskTried


def glued_model(
    task: FitTask, tried: DiskTried, problem: Problem, final: Hypothesis, progress: Callable[[str], None]
) -> StackUnderDiagnosis | None:
    """Return the model of the glued steps on the disk as `problem`, its own, found it; None if there are none.

    Raises FitError for a build that has what stacks in two dimensions lack.
    """
    values = {name: value for name, value in final.values.items() if "@" not in name}
    disk = tried.alone.disk
    plate = stack_of(disk.build, disk.build.step(disk.step))
    known = KnownDisk(
        values,
        tried.whole.model.law,
        posterior(as_refit(problem, final).descent, disk.layer.name),
        tuple(_stated(one, final, plate) for one in final.effects if one.effect.outside or one.effect.of_laws),
    )
    return glued_on(known, task, progress)


def curves_at_every_point(task: FitTask, problem: Problem, final: Hypothesis) -> tuple[Curve, ...]:
    """Return the final curves at all points recorded, of which the fit used some.

    At those only where repeats were averaged.
    """
    found = as_refit(problem, final)
    recordings = found.objective.recordings
    every = [sweep for step in problem.steps for sweep in task.sweeps[step]]
    if len(every) != len(recordings):
        return curves_of(found.objective, found.descent.x, found.descent.x)
    whole: list[Recording] = []
    for one, sweep in zip(recordings, every, strict=True):
        within = sweep.at(sweep.frequency <= one.sweep.frequency[-1])
        whole.append(replace(one, sweep=within, noise=np.ones(within.frequency.size)))
    return curves_of(found.objective.with_recordings(whole), found.descent.x, found.descent.x)


def _stated(one: Candidate, final: Hypothesis, plate: Stack) -> EffectSpec:
    """Return an effect with the sizes found, as a build states what is known.

    `plate`: the disk without its law of losses. What an effect needs beside that only, as the companion of a loss, a
    causal disk has whole.
    """
    knobs = one.effect.effect_parameters(plate, one.where)
    values = {knob.name: knob.upper if knob.fraction else knob.null for knob in knobs}
    values |= {knob.name: final.values[one.prefix + knob.name] for knob in one.effect_parameters}
    return EffectSpec(one.effect.name, one.where, {name: Quantity(value) for name, value in values.items()})


def together(of_disk: Diagnosis, of_glued: Diagnosis) -> Diagnosis:
    """Return what was found in the disk, and in what was glued to it on top of that."""
    first, later = of_disk.final, of_glued.final
    points = [sum(curve.frequency.size for curve in one.after) for one in (of_disk, of_glued)]

    def pooled(name: str) -> float:
        each = zip((first, later), points, strict=True)
        return sum(getattr(summary, name) * count for summary, count in each) / sum(points)

    worse = max((of_disk, of_glued), key=lambda one: one.final.chi2_per_dof)
    return replace(
        worse,
        verdict=_verdict(of_disk, of_glued),
        baseline=of_disk.baseline,
        final=FitSummary(pooled("chi2_per_dof"), pooled("held_out"), {**later.constants, **first.constants}),
        findings=(*of_disk.findings, *of_glued.findings),
        not_decidable=(*of_disk.not_decidable, *of_glued.not_decidable),
        before=(*of_disk.before, *of_glued.before),
        after=(*of_disk.after, *of_glued.after),
        held_out_Hz=(*of_disk.held_out_Hz, *of_glued.held_out_Hz),
        data=of_disk.data,
        remarks=(*of_disk.remarks, *of_glued.remarks),
        places=(*of_disk.places, *of_glued.places),
        effects=(*of_disk.effects, *of_glued.effects),
        seconds=of_glued.seconds,
    )


def _verdict(of_disk: Diagnosis, of_glued: Diagnosis) -> Verdict:
    """Return the verdict on both: what either leaves unexplained is left."""
    verdicts = {of_disk.verdict, of_glued.verdict}
    if verdicts <= {"no-mismatch"}:
        return "no-mismatch"
    if verdicts <= {"no-mismatch", "explained"}:
        return "explained"
    return "unexplained" if verdicts <= {"no-mismatch", "unexplained"} else "partly-explained"
