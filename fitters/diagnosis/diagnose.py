"""The complete diagnosis of a build: data checks, hypotheses, validation, open questions, verdict."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from ..engine.fitted_model import Diagnosable
from ..interface import FitTask, TaskError
from ..plugins import DEFAULT, load_fitter
from ..uncertainty.fit_result import curves_of
from ..user_effects import every_effect
from .data_quality.data_gates import Gated, gate
from .decision_rules import NAMED
from .findings import CorrectionCurve, Diagnosis, Finding, FitSummary, Leftover, MismatchPlace, Remaining, Verdict
from .hypotheses.bench_effects import BenchEffect, with_bench_effects
from .hypotheses.candidates import candidates, flaws
from .hypotheses.held_out import BANDS, bands_of
from .hypotheses.instrument_artefacts import ANY, UNKNOWN
from .hypotheses.problem import Problem
from .inference import finite_diameter as lateral
from .inference.conclusion import Conclusion, NamedEffect, conclude
from .inference.data_findings import of_the_data, verdict_with, where_disturbed
from .inference.effect_size import constants_of, parameters_of
from .inference.stated_effects import stated
from .inference.undetectable import not_decidable
from .learning.learned_effect import Learning
from .learning.places import PlacedCorrection, placed_corrections
from .search.greedy_search import GreedySearch
from .search.refit import Refit, as_refit
from .search.score_test import scores
from .validation.bands import excess_of, guilty_bands
from .validation.cross_sample import carried_over
from .validation.held_out_misfit import held_out_chi2, unforeseen
from .validation.residual_summary import in_words, remainder

_NOT_CARRIED = "A finite diameter cannot be tested on another sample: diagnose that sample by itself."


def diagnose(
    task: FitTask,
    effects: Iterable[str] | None = None,
    progress: Callable[[str], None] = lambda _: None,
    hold_out: str = BANDS,
    others: Mapping[str, FitTask] | None = None,
    learn: bool = False,
    known: Sequence[BenchEffect] = (),
    jobs: int = 1,
    fitter: Diagnosable | None = None,
) -> Diagnosis:
    """Diagnose where recordings and model differ, which physics is missing, and what cannot be decided.

    `effects` names the catalogue effects to consider; None considers all. `hold_out` is one of `held_out.KINDS`: the
    data reserved for validation. `others` are further samples by name, on which the findings are tested. `learn`:
    whether to look for a law of what no effect of the catalogue explains. `known` are effects at the terminals that all
    samples of the bench have: they are part of every hypothesis. `jobs`: number of processes that fit hypotheses at the
    same time; the result does not depend on it. `fitter`: whose model is diagnosed, in place of the stack; effects
    inside of a device are no candidates then, and laws are not learned. Raises FitError if the recordings cannot be
    fitted or contain no such data to hold out, TaskError for effects that the fitter's model cannot have, EffectError
    for an unknown effect.
    """
    began = time.perf_counter()
    effects = _possible(effects, fitter)
    progress("checking the data")
    gated = gate(task.sweeps)
    progress("fitting without effects")
    bare = Problem.posed(replace(task, sweeps=gated.sweeps), progress, fitter, hold_out)
    problem, taken = with_bench_effects(bare, known), {one.name for one in known}
    choice = tuple(one for one in candidates(problem, effects) if one.effect.name not in taken)
    search = GreedySearch(problem, (*choice, *flaws(problem)), progress, jobs)
    search.run()
    found = conclude(search)
    progress("validating on held-out data")
    null, final = as_refit(problem, found.null), as_refit(problem, found.final)
    held_before, held_after = held_out_chi2(problem, null), held_out_chi2(problem, final)
    stated_none = task.build is not None and not task.build.effects
    if found.something_left and stated_none and any(one.effect.name == lateral.NAME for one in choice):
        wide = lateral.finite(replace(task, sweeps=gated.sweeps), null, final, progress, jobs)
        if wide is not None:
            return _in_two_dimensions(wide, problem, found, (null, held_before), gated, began, bool(others))
    if learn and fitter is None:
        found, places = Learning(search.problem, progress, jobs).learned(found, search.ranked)
        final = as_refit(problem, found.final)
        held_after = held_out_chi2(problem, final)
    elif found.something_left and fitter is None:
        places = placed_corrections(search.problem, found.final, progress, jobs, thorough=False)
    else:
        places = ()
    kept = [one for one in found.named if not where_disturbed(gated, one.candidate, final)]
    found = replace(found, named=tuple(kept))
    # where a mismatch was found, the likelihood is an approximation, for the constants as for the effects
    coarse = found.final.coarseness if found.verdict != "no-mismatch" else 1.0
    told = [(one, _finding(problem, one, found, final, (held_before, held_after), coarse)) for one in found.named]
    left = remainder(final)
    findings = [said for one, said in told if one.kind == "finding"]
    findings = [*of_the_data(gated, null.chi2_per_dof, held_before), *findings]
    verdict = verdict_with(gated, found.verdict)
    if verdict in ("unexplained", "partly-explained") and not any(one.effect == UNKNOWN for one in findings):
        findings.append(_unknown(final, held_after, left, () if learn else places, found.something_else))
    constants = constants_of(problem, found.final, coarse)
    proofs = tuple(
        carried_over(problem, final, name, other, progress, fitter) for name, other in (others or {}).items()
    )
    progress("searching for effects that the constants would hide")
    remaining = scores(problem, choice, final.objective, final.descent.x)
    return Diagnosis(
        verdict=verdict,
        baseline=FitSummary(null.chi2_per_dof, held_before, constants_of(problem, found.null)),
        final=FitSummary(final.chi2_per_dof, held_after, constants),
        findings=tuple(findings),
        not_decidable=not_decidable(final, remaining, constants, {one.effect for one in findings}),
        leftover=left,
        says=(*_says(verdict, findings), *_nearest(found)) if verdict == "unexplained" else _says(verdict, findings),
        before=curves_of(null.objective, null.descent.x, null.descent.x),
        after=curves_of(final.objective, final.descent.x, final.descent.x),
        data=gated.checks,
        held_out_Hz=tuple(map(bands_of, problem.recordings, problem.proof)),
        others=proofs,
        remaining=found.remaining,
        remarks=tuple(said for one, said in told if one.kind == "remark"),
        places=tuple(_place(one) for one in places),
        effects=stated(problem, found.final, [one for one, _ in told], coarse),
        seconds=time.perf_counter() - began,
    )


def fitter_to_diagnose(name: str) -> Diagnosable | None:
    """Return the installed fitter whose model is to be diagnosed; None for `mason`, whose stacks are diagnosed.

    Raises TaskError for a fitter whose model cannot be diagnosed, PluginError for one that is not installed.
    """
    if name == DEFAULT:
        return None
    fitter = load_fitter(name)
    if not isinstance(fitter, Diagnosable):
        raise TaskError(
            f"the model of fitter {name!r} cannot be diagnosed, for it has no `fitted_model`; of the fitters of pzctl "
            "mason, radial, disk, disk2d and bvd can"
        )
    return fitter


def _possible(effects: Iterable[str] | None, fitter: Diagnosable | None) -> tuple[str, ...] | None:
    """Return the effects to consider. Raises TaskError for one that acts inside a stack, if the model is none."""
    named = None if effects is None else tuple(effects)
    if fitter is None or named is None:
        return named
    outside = [one.name for one in every_effect() if one.outside]
    for name in named:
        if name not in outside:
            raise TaskError(
                f"effect {name!r} acts in the layers of a stack, which the model of `{fitter.name}` is not; it can "
                f"have {', '.join(outside)}"
            )
    return named


def _place(one: PlacedCorrection) -> MismatchPlace:
    """Return a place as it is shown."""
    curve = CorrectionCurve(
        frequency_Hz=tuple(one.frequency.tolist()),
        re=tuple(one.correction.real.tolist()),
        im=tuple(one.correction.imag.tolist()),
        u_re=tuple(one.u_re.tolist()),
        u_im=tuple(one.u_im.tolist()),
    )
    says = f"A correction of {one.place.says} that depends on frequency would explain what is left."
    return MismatchPlace(one.place.where, one.place.quantity, one.steps[0], one.probability, says, curve)


def _nearest(found: Conclusion) -> tuple[str, ...]:
    """Return a sentence on the effect that explains most of the misfit without being probable enough to be named."""
    if found.nearest is None:
        return ()
    one, share = found.nearest
    name = f"{one.effect.name} at {one.where}"
    return (f"The closest explanation is {name}: it explains {100 * share:.0f} % of the misfit.",)


def _in_two_dimensions(
    wide: lateral.FiniteDisk,
    problem: Problem,
    found: Conclusion,
    baseline: tuple[Refit, float],
    gated: Gated,
    began: float,
    others: bool,
) -> Diagnosis:
    """Return the diagnosis of a disk whose finite diameter explains what a plate model does not."""
    null, held_before = baseline
    own = lateral.findings_of(wide, null, held_before)
    findings = [*of_the_data(gated, null.chi2_per_dof, held_before), *own]
    verdict = verdict_with(gated, "explained" if wide.described else "partly-explained")
    before = curves_of(null.objective, null.descent.x, null.descent.x)
    return Diagnosis(
        verdict=verdict,
        baseline=FitSummary(null.chi2_per_dof, held_before, constants_of(problem, found.null)),
        final=FitSummary(wide.result.chi2_per_dof, float("nan"), wide.result.constants),
        findings=tuple(findings),
        not_decidable=(),
        leftover=Leftover((), wide.result.chi2_per_dof, own[0].step, (), None),
        says=(*_says(verdict, findings), *([_NOT_CARRIED] if others else [])),
        before=before,
        after=lateral.curves(wide, before),
        data=gated.checks,
        remaining=Remaining(wide.result.rms_log_error, 0.0),
        seconds=time.perf_counter() - began,
    )


def _finding(
    problem: Problem, named: NamedEffect, found: Conclusion, final: Refit, held: tuple[float, float], coarse: float
) -> Finding:
    candidate, without = named.candidate, as_refit(problem, named.without)
    fall = excess_of(without.in_noise, final.in_noise)
    bands = [
        band
        for recording, excess in zip(problem.recordings, fall, strict=True)
        if recording.step in candidate.steps
        for band in guilty_bands(recording.sweep.frequency, 1 + excess)
    ]
    before = held_out_chi2(problem, without) if len(final.effects) > 1 else held[0]
    sizes = parameters_of(candidate, found.final, coarse)
    says = candidate.effect.sentence(
        candidate.where, {name: (size.value, size.u, size.unit) for name, size in sizes.items()}
    )
    twins = [other.where for other in named.same_as if other.effect == candidate.effect.name]
    says += "".join(f" At {place} it would look the same." for place in twins)
    if candidate in unforeseen(problem, final):
        says += " It shows in the held-out data only, which therefore validate the rest of the fit but not this effect."
    return Finding(
        effect=candidate.effect.name,
        where=candidate.where,
        step=candidate.step,
        probability=named.probability,
        bands_Hz=tuple(bands[:5]),
        parameters=sizes,
        chi2_per_dof_before=without.chi2_per_dof,
        chi2_per_dof_after=final.chi2_per_dof,
        held_out_before=before,
        held_out_after=held[1],
        alternatives=named.alternatives,
        says=says,
        share=named.share,
        same_as=named.same_as,
        moves=named.moves,
    )


def _unknown(
    final: Refit, held: float, left: Leftover, places: Sequence[PlacedCorrection], probability: float
) -> Finding:
    likely = [one for one in places[:1] if one.probability > NAMED]
    where = "".join(
        f" Most probably (P = {one.probability:.2f}) it acts on {one.place.says}; `--learn` looks for its law."
        for one in likely
    )
    return Finding(
        effect=UNKNOWN,
        where=ANY,
        step=left.step,
        probability=probability,
        bands_Hz=left.bands_Hz,
        parameters={},
        chi2_per_dof_before=final.chi2_per_dof,
        chi2_per_dof_after=final.chi2_per_dof,
        held_out_before=held,
        held_out_after=held,
        alternatives=(),
        says="No effect of the catalogue explains the misfit; find its cause before you use the constants. "
        f"{in_words(left)}".rstrip()
        + where,
    )


def _says(verdict: Verdict, findings: list[Finding]) -> tuple[str, ...]:
    first = {
        "no-mismatch": "Model and recording agree to within the noise.",
        "explained": "Model and recording differ; the effects found explain the whole difference.",
        "partly-explained": "Model and recording differ; the effects found explain most of the difference, not all.",
        "unexplained": "Model and recording differ, and no effect of the catalogue explains the difference.",
    }[verdict]
    return (first, *(f"{finding.effect} at {finding.where}: {finding.says}" for finding in findings))
