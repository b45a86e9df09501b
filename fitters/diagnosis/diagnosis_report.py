"""From a conclusion to a diagnosis: figures before and after, a finding for each named effect, and sentences."""

import time
from collections.abc import Sequence
from dataclasses import replace
from math import inf, isfinite

import numpy as np

from ...models.effects.learned.corrections import INSTRUMENT
from ...models.effects.learned.learned import LearnedLaw
from ..error_model.uncertainty_sources import taken_up
from ..interface import Curve
from ..uncertainty.fit_result import curves_of
from .data_quality.data_gates import Gated
from .decision_rules import NAMED
from .diagnosis_request import DiagnosisRequest
from .findings import CorrectionCurve, Diagnosis, Finding, FitSummary, Leftover, MismatchPlace, Remaining, Verdict
from .hypotheses.held_out import bands_of
from .hypotheses.hypothesis import Hypothesis, beside
from .hypotheses.instrument_artefacts import ANY, UNKNOWN
from .hypotheses.model_under_diagnosis import LayeredModel
from .hypotheses.problem import Candidate, Problem
from .hypotheses.size_priors import unusual_size
from .inference.averaged_constants import averaged_constants
from .inference.conclusion import Conclusion, NamedEffect
from .inference.data_findings import of_the_data, verdict_with, where_disturbed
from .inference.effect_size import constants_of, parameters_of
from .inference.stated_effects import stated
from .inference.uncertainty_by_source import by_source
from .inference.undetectable import not_decidable
from .learning.drawn_corrections import PlacedCorrection
from .learning.learned_effect import Learning
from .learning.places import placed_corrections
from .search.greedy_search import GreedySearch
from .search.refit import as_refit
from .search.score_test import scores
from .validation.bands import excess_of, guilty_bands
from .validation.cross_sample import carried_over
from .validation.held_out_misfit import unforeseen
from .validation.improvement import LeastSquares
from .validation.residual_summary import in_words, remainder
from .validation.whole_device import whole_device

_CUT_SHORT = "The search ended at its budget of evaluations: combinations of effects that explain more may exist."
_OF_A_RING = "The device is a ring, and effects may stand for its lateral modes: diagnose it with --fitter stack2d."


def baseline_of(problem: Problem, fit: LeastSquares, null: Hypothesis) -> FitSummary:
    """Return the fit without effects, with the constants of the hypothesis that there are none."""
    return FitSummary(fit.chi2_per_dof, fit.held_out, by_source(problem, null, constants_of(problem, null)))


def reported(
    search: GreedySearch,
    choice: tuple[Candidate, ...],
    found: Conclusion,
    gated: Gated,
    wanted: DiagnosisRequest,
    began: float,
) -> Diagnosis:
    """Return what was found as a diagnosis."""
    progress, jobs, fitter, learn = wanted.progress, wanted.jobs, wanted.fitter, wanted.learn
    problem = replace(search.problem, local=())
    progress("validating on held-out data")
    if learn:
        found, places = Learning(search.problem, progress, jobs).learned(found, search.ranked)
    elif found.something_left and fitter is None:
        places = placed_corrections(search.problem, found.final, progress, jobs, thorough=False)
    else:
        places = ()
    final = as_refit(problem, found.final)
    kept = [one for one in found.named if not where_disturbed(gated, one.candidate, final)]
    found = replace(found, named=tuple(kept))
    # where a mismatch was found, the likelihood is an approximation, for the constants as for the effects
    coarse = found.final.coarseness if found.verdict != "no-mismatch" else 1.0
    before = LeastSquares.of(problem, found.null)
    after = LeastSquares.of(problem, found.final) if found.final.effects else before
    told = [(one, _finding(problem, one, found, before, after, coarse)) for one in found.named]
    left = remainder(final)
    findings = [said for one, said in told if one.kind == "finding"]
    # a polarity has no size, and is first: nothing could be fitted before it was put right
    findings = sorted([*of_the_data(gated, before.chi2_per_dof, before.held_out), *findings], key=_smallness)
    verdict = verdict_with(gated, found.verdict)
    if verdict in ("unexplained", "partly-explained") and not any(one.effect == UNKNOWN for one in findings):
        findings.append(_unknown(after, left, _where_it_acts(places, found, learn=learn), found))
    averaged = averaged_constants(problem, found.final, search.ranked, coarse)
    constants = by_source(problem, found.final, averaged, coarse)
    proofs = tuple(carried_over(problem, final, name, other, progress, fitter) for name, other in wanted.others.items())
    progress("searching for effects that the constants would hide")
    others = beside(final.effects, choice)
    remaining = scores(problem, others, final.objective, final.descent.x, found.final.errors)
    return Diagnosis(
        verdict=verdict,
        baseline=baseline_of(problem, before, found.null),
        final=FitSummary(after.chi2_per_dof, after.held_out, constants),
        findings=tuple(findings),
        not_decidable=not_decidable(final, remaining, constants, {one.effect for one in findings}),
        leftover=left,
        says=(
            *says_of(verdict, findings, found.remaining),
            *((whole_device(found.final).says,) if _has_learned(found) else ()),
            *(_nearest(found) if verdict == "unexplained" and not found.undecided else ()),
            *((_CUT_SHORT,) if search.cut_short else ()),
            *((_OF_A_RING,) if verdict != "no-mismatch" and _is_a_plate_of_a_ring(problem) else ()),
        ),
        before=curves_of(before.fit.objective, before.fit.descent.x, before.fit.descent.x),
        after=_with_errors(curves_of(final.objective, final.descent.x, final.descent.x), found),
        data=gated.checks,
        held_out_Hz=tuple(map(bands_of, problem.recordings, problem.proof)),
        others=proofs,
        remaining=found.remaining,
        remarks=tuple(said for one, said in told if one.kind == "remark"),
        places=tuple(_place(one, problem.steps) for one in places),
        effects=stated(problem, found.final, [one for one, _ in told], coarse),
        exact=found.final.fit.exact,
        seconds=time.perf_counter() - began,
    )


def _smallness(one: Finding) -> float:
    return -one.moves if isfinite(one.moves) else -inf


def _place(one: PlacedCorrection, steps: tuple[str, ...]) -> MismatchPlace:
    """Return a place as it is shown; `steps`: those that were recorded."""
    curve = CorrectionCurve(
        frequency_Hz=tuple(one.frequency.tolist()),
        re=tuple(one.correction.real.tolist()),
        im=tuple(one.correction.imag.tolist()),
        u_re=tuple(one.u_re.tolist()),
        u_im=tuple(one.u_im.tolist()),
    )
    there = "" if one.steps == steps else f" in {' and '.join(one.steps)}"
    says = f"A correction of {one.place.says}{there} that depends on frequency would explain what is left."
    return MismatchPlace(one.place.where, one.place.quantity, one.steps[0], one.probability, says, curve)


def _nearest(found: Conclusion) -> tuple[str, ...]:
    """Return a sentence on the effect that explains most of the misfit without being probable enough to be named."""
    if found.nearest is None:
        return ()
    one, share = found.nearest
    name = f"{one.effect.name} at {one.where}"
    return (f"The closest explanation is {name}: it explains {100 * share:.0f} % of the misfit.",)


def _finding(
    problem: Problem, named: NamedEffect, found: Conclusion, before: LeastSquares, after: LeastSquares, coarse: float
) -> Finding:
    candidate = named.candidate
    without = LeastSquares.of(problem, named.without) if named.without.effects else before
    fall = excess_of(without.fit.in_noise, after.fit.in_noise)
    bands = [
        band
        for recording, excess in zip(problem.recordings, fall, strict=True)
        if recording.step in candidate.steps
        for band in guilty_bands(recording.sweep.frequency, 1 + excess)
    ]
    sizes = parameters_of(candidate, found.final, coarse)
    says = candidate.effect.sentence(
        candidate.where, {name: (size.value, size.u, size.unit) for name, size in sizes.items()}
    )
    twins = [other.where for other in named.same_as if other.effect == candidate.effect.name]
    says += "".join(f" At {place} it would look the same." for place in twins)
    if unusual := unusual_size(candidate, {name: size.value for name, size in sizes.items()}):
        says += f" {unusual}"
    if candidate in unforeseen(problem, after.fit):
        says += " It shows in the held-out data only, which therefore validate the rest of the fit but not this effect."
    return Finding(
        effect=candidate.effect.name,
        where=candidate.where,
        step=candidate.step,
        probability=named.probability,
        bands_Hz=tuple(bands[:5]),
        parameters=sizes,
        chi2_per_dof_before=without.chi2_per_dof,
        chi2_per_dof_after=after.chi2_per_dof,
        held_out_before=without.held_out,
        held_out_after=after.held_out,
        alternatives=named.alternatives,
        says=says,
        share=after.share_beside(without),
        same_as=named.same_as,
        moves=named.moves,
    )


def _has_learned(found: Conclusion) -> bool:
    return any(isinstance(one.effect, LearnedLaw) for one in found.final.effects)


def _where_it_acts(places: Sequence[PlacedCorrection], found: Conclusion, *, learn: bool) -> str:
    """Return a sentence on the place of what is left, if one is more likely than not; empty if a law was learned."""
    best = max(places, key=lambda one: one.probability, default=None)
    if best is None or best.probability <= NAMED or _has_learned(found):
        return ""
    hint = "" if learn or best.place == INSTRUMENT else "; `--learn` looks for its law"
    return f" Most probably (P = {best.probability:.2f}) it acts on {best.place.says}{hint}."


def _unknown(after: LeastSquares, left: Leftover, where: str, found: Conclusion) -> Finding:
    unproved = found.forecast.says if found.forecast is not None and found.refuted else None
    misfit = "what the effects found leave" if found.findings else "the misfit"
    says = unproved or f"No effect of the catalogue explains {misfit}; find its cause before you use the constants."
    if found.undecided:
        names = ", ".join(f"{one.effect} at {one.where} ({one.probability:.2f})" for one in found.undecided)
        several = "one of these, which the recordings do not tell apart: " if len(found.undecided) > 1 else ""
        says = f"Something is there; most probably {several}{names}."
    return Finding(
        effect=UNKNOWN,
        where=ANY,
        step=left.step,
        probability=found.something_else,
        bands_Hz=left.bands_Hz,
        parameters={},
        chi2_per_dof_before=after.chi2_per_dof,
        chi2_per_dof_after=after.chi2_per_dof,
        held_out_before=after.held_out,
        held_out_after=after.held_out,
        alternatives=found.undecided,
        says=f"{says} {in_words(left)}".rstrip() + where,
    )


def _with_errors(curves: Sequence[Curve], found: Conclusion) -> tuple[Curve, ...]:
    """Return the curves with the most probable errors of instrument and device, if the recordings have any."""
    if not found.remaining.erring:
        return tuple(curves)
    left = taken_up(found.final.fit).left
    return tuple(
        replace(curve, explained=curve.measured * np.exp(own)) for curve, own in zip(curves, left, strict=True)
    )


def _is_a_plate_of_a_ring(problem: Problem) -> bool:
    return isinstance(problem.model, LayeredModel) and problem.model.build.hole_diameter is not None


def says_of(verdict: Verdict, findings: Sequence[Finding], remaining: Remaining | None) -> tuple[str, ...]:
    """Return the verdict, a sentence for each finding, and what is left where that is more than noise."""
    left = (remaining.says,) if remaining is not None and remaining.erring else ()
    usual = " and the usual errors of instrument and device" if left else ""
    first = {
        "no-mismatch": f"Model and recording agree to within the noise{usual}.",
        "explained": f"Model and recording differ; the effects found{usual} explain the whole difference.",
        "partly-explained": "Model and recording differ; the effects found explain most of the difference, not all.",
        "unexplained": "Model and recording differ, and no effect of the catalogue is known to explain the difference.",
    }[verdict]
    return (first, *(f"{finding.effect} at {finding.where}: {finding.says}" for finding in findings), *left)
