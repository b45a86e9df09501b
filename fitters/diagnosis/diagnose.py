"""The whole diagnosis of a build: gates, null fit, search, proof, what stays open, and a verdict."""

import time
from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

import numpy as np

from ..engine.covariance import estimate
from ..engine.descent import lag_one
from ..engine.multi_step_fit import solve
from ..engine.parameters.assembly import layers_of
from ..interface import Constant, FitTask
from ..uncertainty.fit_result import curves_of, fitted_constants
from .data_quality.data_findings import of_the_data, verdict_with, where_disturbed
from .data_quality.data_gates import Gated, gate
from .findings import Diagnosis, Finding, Fitted, Leftover, Size, Verdict
from .hypotheses import finite_diameter as lateral
from .hypotheses.candidates import candidates, flaws
from .hypotheses.instrument_artefacts import ANY, UNKNOWN
from .hypotheses.problem import Candidate, Problem
from .inference.evidence import gain
from .inference.posterior import Weighed, better_instead, posterior_probabilities
from .inference.undetectable import not_decidable
from .search.beam_search import Search, backward_elimination, beam_search, drop_artefact_remnants, weightiest
from .search.refit import Refit
from .search.score_test import scores
from .search.trial_fits import DESCRIBED, SIGNIFICANT, null_refit, polish
from .validation.bands import excess_of, guilty_bands
from .validation.cross_sample import carried_over
from .validation.held_out import BANDS, bands_of
from .validation.held_out_misfit import held_out_chi2, unforeseen
from .validation.residual_summary import in_words, remainder
from .validation.whiteness_tests import structured

_FINE = 1e-8
"""Relative tolerance of the fits whose constants are told."""
_EXPLAINED = 1.4
"""chi2 per degree of freedom of every recording up to which the effects found explain it."""
_HELD_OUT = 1.6
"""The same on held-out bands: an explanation that fails there is none."""
_MOST = (0.98, 0.995)
"""Part of the misfit that one effect, or two, must take away to be named although something is left over."""
_MOST_OF_IT = 0.8
"""The same for one, or two, to be mentioned in words."""
_SCATTER = 0.05
"""chi2 per degree of freedom that a recording has more or less by chance, and by how well its noise is known."""
_MOST_NAMED = len(_MOST)
"""Three effects at once describe nearly anything: where two are not enough, the rest is called unknown."""
_NOT_CARRIED = "A finite diameter is not carried over to another sample: diagnose that one by itself."
_RIPPLE = 0.2
"""Correlation of neighbouring residuals from which something is left even where chi2 is small."""


def diagnose(
    task: FitTask,
    effects: Iterable[str] | None = None,
    progress: Callable[[str], None] = lambda _: None,
    hold_out: str = BANDS,
    others: Mapping[str, FitTask] | None = None,
) -> Diagnosis:
    """Say where recordings and model differ, which physics was left out, and what cannot be decided.

    `effects` names those of the catalogue to consider; None considers all. `hold_out` is what is put to the proof:
    one of `heldout.KINDS`. `others` are further samples by name, which what was found is carried over to. Raises
    FitError where the recordings cannot be fitted at all or have nothing of that kind, EffectError for an effect that
    is not known.
    """
    began = time.perf_counter()
    progress("checking the data")
    gated = gate(task.sweeps)
    progress("fitting without effects")
    problem = Problem.of(solve(replace(task, sweeps=gated.sweeps), progress), task.free, hold_out)
    null = polish(problem, null_refit(problem), _FINE)
    choice = candidates(problem, effects)
    search = Search(problem, choice, flaws(problem), progress)
    found = better_instead(search, backward_elimination(search, beam_search(search, null)))
    found = drop_artefact_remnants(search, found)
    progress("proving on what took no part")
    held_before = held_out_chi2(problem, null)
    final, held_after, verdict, nearest = _explained(search, null, found, held_before)
    if verdict in ("unexplained", "partly-explained") and any(one.effect.name == lateral.NAME for one in choice):
        wide = lateral.finite(replace(task, sweeps=gated.sweeps), null, final, progress)
        if wide is not None:
            return _in_two_dimensions(wide, problem, null, held_before, gated, began, bool(others))
    weighed = [
        one for one in posterior_probabilities(search, final) if not where_disturbed(gated, one.candidate, final)
    ]
    if final.effects and not weighed:
        verdict = "unexplained"
    left = remainder(final)
    findings = [_finding(problem, one, final, held_before, held_after) for one in weighed]
    findings = [*of_the_data(gated, null.chi2_per_dof, held_before), *findings]
    disturbed = any(finding.effect == UNKNOWN for finding in findings)
    if verdict in ("unexplained", "partly-explained") and not disturbed:
        findings.append(_unknown(final, held_after, left))
    constants = _constants(problem, final)
    proofs = tuple(carried_over(problem, final, name, other, progress) for name, other in (others or {}).items())
    progress("asking what stays open")
    remaining = scores(problem, choice, final.objective, final.descent.x)
    taken = {finding.effect for finding in findings}
    verdict = verdict_with(gated, _unnamed(final, verdict))
    return Diagnosis(
        verdict=verdict,
        baseline=Fitted(null.chi2_per_dof, held_before, _constants(problem, null)),
        final=Fitted(final.chi2_per_dof, held_after, constants),
        findings=tuple(findings),
        not_decidable=not_decidable(final, remaining, constants, taken),
        leftover=left,
        says=(*_says(verdict, findings), *nearest),
        before=curves_of(null.objective, null.descent.x, null.descent.x),
        after=curves_of(final.objective, final.descent.start, final.descent.x),
        data=gated.checks,
        held_out_Hz=tuple(map(bands_of, problem.recordings, problem.proof)),
        others=proofs,
        seconds=time.perf_counter() - began,
    )


def _explained(
    search: Search, null: Refit, found: Refit, held_before: float
) -> tuple[Refit, float, Verdict, tuple[str, ...]]:
    """Return the fit with what may be named of what was found, its misfit on held-out bands, and the verdict.

    Last, in words, what comes nearest where less than was found may be named. `held_before` is the null fit's.
    """
    nearest: tuple[str, ...] = ()
    for most in range(min(_MOST_NAMED, len(found.effects)), 0, -1):
        final = _finest(search, weightiest(search, found, most))
        held_out = held_out_chi2(search.problem, final)
        verdict = _verdict(search, null, final, held_out, crowded=gain(final, found) > SIGNIFICANT)
        if verdict is not None:
            return final, held_out, verdict, ()
        nearest = nearest or _nearest(null, final, held_out)
    return null, held_before, "unexplained" if found.effects or _something_left(null) else "no-mismatch", nearest


def _finest(search: Search, found: Refit) -> Refit:
    """Return a fit made fine, with look-alikes in the place of effects where they are better then."""
    final = polish(search.problem, found, _FINE)
    again = better_instead(search, final)  # a fit that fine may be no better than its look-alikes
    return polish(search.problem, again, _FINE) if again is not final else final


def _in_two_dimensions(
    wide: lateral.FiniteDisk,
    problem: Problem,
    null: Refit,
    held_before: float,
    gated: Gated,
    began: float,
    others: bool,
) -> Diagnosis:
    """Return the diagnosis of a disk whose finite diameter explains what a plate does not."""
    own = [lateral.finding_of(wide, null, held_before)]
    findings = [*of_the_data(gated, null.chi2_per_dof, held_before), *own]
    verdict = verdict_with(gated, "explained" if wide.described else "partly-explained")
    before = curves_of(null.objective, null.descent.x, null.descent.x)
    return Diagnosis(
        verdict=verdict,
        baseline=Fitted(null.chi2_per_dof, held_before, _constants(problem, null)),
        final=Fitted(wide.result.chi2_per_dof, float("nan"), wide.result.constants),
        findings=tuple(findings),
        not_decidable=(),
        leftover=Leftover((), wide.result.chi2_per_dof, own[0].step, (), None),
        says=(*_says(verdict, findings), *([_NOT_CARRIED] if others else [])),
        before=before,
        after=lateral.curves(wide, before),
        data=gated.checks,
        seconds=time.perf_counter() - began,
    )


def _verdict(search: Search, null: Refit, final: Refit, held_after: float, crowded: bool) -> Verdict | None:
    """Return the verdict if the effects of the final fit may be named, else None.

    An effect in the wrong family is often flexible enough to take away much of a misfit. So effects are named only
    where they take away nearly all of it, and on bands that took no part too; where much is left over, each must take
    away nearly all of what the other one leaves. `crowded`: a further one was needed.
    """
    left = max(final.chi2_per_dof - 1, _SCATTER)
    nearly_all = _taken_away(null, final) > _MOST[len(final.effects) - 1]
    if max(final.chi2) < _EXPLAINED and not crowded and (nearly_all or not structured(final.in_noise)):
        return "explained" if held_after < _HELD_OUT else None
    if max(final.chi2) > _EXPLAINED:
        others = [search.without(final, one).chi2_per_dof for one in final.effects]
        nearly_all = nearly_all and all(left < (1 - _MOST[0]) * (chi2 - 1) for chi2 in others)
    return "partly-explained" if nearly_all else None


def _taken_away(null: Refit, found: Refit) -> float:
    """Return the part of the misfit that effects take away, no more of it than can be told from chance."""
    return 1 - max(found.chi2_per_dof - 1, _SCATTER) / max(null.chi2_per_dof - 1, _SCATTER)


def _unnamed(final: Refit, verdict: Verdict) -> Verdict:
    """Return the verdict where part of what explains a recording is a flaw that no catalogue has."""
    flawed = [one.effect.name == UNKNOWN for one in final.effects]
    if not any(flawed):
        return verdict
    return "unexplained" if all(flawed) else "partly-explained"


def _something_left(found: Refit) -> bool:
    ripple = max(lag_one(ratio) for ratio in found.objective.log_ratios(found.descent.x))
    return max(found.chi2) > DESCRIBED or ripple > _RIPPLE or structured(found.in_noise)


def _finding(problem: Problem, weighed: Weighed, final: Refit, held_before: float, held_after: float) -> Finding:
    candidate, without = weighed.candidate, weighed.without
    fall = excess_of(without.in_noise, final.in_noise)
    bands = [
        band
        for recording, excess in zip(problem.recordings, fall, strict=True)
        if recording.step in candidate.steps
        for band in guilty_bands(recording.sweep.frequency, 1 + excess)
    ]
    before = held_out_chi2(problem, without) if len(final.effects) > 1 else held_before
    says = candidate.effect.says.format(where=candidate.where)
    says += "".join(f" At {place} it would look the same." for place in weighed.same_at)
    if candidate in unforeseen(problem, final):
        says += " It lies within what was held out, which therefore proves the rest of the fit but not this."
    return Finding(
        effect=candidate.effect.name,
        where=candidate.where,
        step=candidate.step,
        probability=weighed.probability,
        bands_Hz=tuple(bands[:5]),
        parameters=_sizes(candidate, final),
        chi2_per_dof_before=without.chi2_per_dof,
        chi2_per_dof_after=final.chi2_per_dof,
        held_out_before=before,
        held_out_after=held_after,
        alternatives=weighed.alternatives,
        says=says,
    )


def _sizes(candidate: Candidate, final: Refit) -> dict[str, Size]:
    """Return the parameters of an effect as people are shown them, with standard uncertainties."""
    names = final.objective.coordinates.parameters
    covariance = estimate(final.descent).covariance
    # a parameter that ran beyond its limit is as it is there
    values = {
        knob.name: min(max(final.values[candidate.prefix + knob.name], knob.lower), knob.upper)
        for knob in candidate.effect_parameters
    }
    u = {
        knob.name: float(np.sqrt(max(0.0, covariance[k, k])))
        for knob in candidate.effect_parameters
        for k in [names.index(candidate.prefix + knob.name)]
    }
    sizes = {knob.name: Size(values[knob.name], u[knob.name], knob.unit) for knob in candidate.effect_parameters}
    first = candidate.effect_parameters[0]
    for name, (value, unit) in candidate.effect.shown(values).items():
        more = candidate.effect.shown({**values, first.name: values[first.name] + u[first.name]})[name][0]
        sizes[name] = Size(value, abs(more - value), unit)
    return sizes


def _unknown(final: Refit, held: float, left: Leftover) -> Finding:
    return Finding(
        effect=UNKNOWN,
        where=ANY,
        step=left.step,
        probability=0.95,
        bands_Hz=left.bands_Hz,
        parameters={},
        chi2_per_dof_before=final.chi2_per_dof,
        chi2_per_dof_after=final.chi2_per_dof,
        held_out_before=held,
        held_out_after=held,
        alternatives=(),
        says="Something is there that no effect of the catalogue explains; look at the bands before using constants. "
        f"{in_words(left)}".rstrip(),
    )


def _constants(problem: Problem, found: Refit) -> dict[str, Constant]:
    result = estimate(found.descent)
    layers = layers_of(problem.build, problem.steps)
    return fitted_constants(layers, found.values, found.objective.coordinates.parameters, result.covariance)


def _nearest(null: Refit, found: Refit, held_out: float) -> tuple[str, ...]:
    """Return a sentence on what takes away most of a misfit, but not enough to be named; none where nothing does."""
    share = _taken_away(null, found)
    names = [f"{one.effect.name} at {one.where}" for one in found.effects]
    if not names or share < _MOST_OF_IT or any(one.effect.name == UNKNOWN for one in found.effects):
        return ()
    of_it = f"{np.floor(1000 * share) / 10:g} % of the misfit"  # what is not all of it is not told as all of it
    left = f"{found.chi2_per_dof:.3g} times what noise makes"
    if max(found.chi2) < _EXPLAINED and held_out >= _HELD_OUT:
        left += f", but {held_out:.3g} times on what was held out of the fit"
    one = len(names) == 1
    takes, leaves, them = ("it takes", "leaves", "it") if one else ("they take", "leave", "them")
    said = f"Nearest comes {' and '.join(names)}: {takes} away {of_it} and {leaves} {left}"
    return (f"{said}, too much for {them} to be named.",)


def _says(verdict: Verdict, findings: list[Finding]) -> tuple[str, ...]:
    first = {
        "no-mismatch": "Model and recording agree to within the noise.",
        "explained": "Model and recording differ, and what was left out explains all of it.",
        "partly-explained": "Model and recording differ; what was found explains most of it, but something is left.",
        "unexplained": "Model and recording differ, and nothing in the catalogue explains it.",
    }[verdict]
    return (first, *(f"{finding.effect} at {finding.where}: {finding.says}" for finding in findings))
