"""The complete diagnosis of a build: data checks, hypotheses, validation, open questions, verdict."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from math import inf, isfinite

import numpy as np

from ...models.effects.base.effect import TERMINALS
from ...models.effects.learned.corrections import INSTRUMENT
from ...models.effects.learned.learned import LearnedLaw
from ..disk.two_d.disk2d import Disk2DFitter
from ..engine.fitted_model import Diagnosable, FittedModel
from ..error_model.uncertainty_sources import taken_up
from ..interface import UNCOMPUTABLE, Curve, FitError, FitTask, TaskError
from ..layered.two_d.stack2d import Stack2DFitter
from ..layered.two_d.stack_under_diagnosis import StackUnderDiagnosis
from ..plugins import DEFAULT, load_fitter
from ..uncertainty.fit_result import curves_of
from ..user_effects import every_effect
from .data_quality.data_gates import Gated, gate
from .decision_rules import BEHIND_WIRES, NAMED
from .findings import CorrectionCurve, Diagnosis, Finding, FitSummary, Leftover, MismatchPlace, Remaining, Verdict
from .hypotheses.bench_effects import BenchEffect, with_bench_effects
from .hypotheses.candidates import candidates, flaws
from .hypotheses.held_out import BANDS, bands_of
from .hypotheses.hypothesis import Hypothesis, beside
from .hypotheses.instrument_artefacts import ANY, UNKNOWN
from .hypotheses.model_under_diagnosis import LayeredModel
from .hypotheses.problem import Candidate, Problem
from .hypotheses.size_priors import unusual_size
from .inference import finite_diameter as lateral
from .inference.averaged_constants import averaged_constants
from .inference.conclusion import Conclusion, NamedEffect, conclude
from .inference.data_findings import POLARITY, of_the_data, verdict_with, where_disturbed
from .inference.effect_size import constants_of, parameters_of
from .inference.glued_steps import curves_at_every_point, glued_model, together
from .inference.stated_effects import stated
from .inference.uncertainty_by_source import by_source
from .inference.undetectable import not_decidable
from .learning.drawn_corrections import PlacedCorrection
from .learning.learned_effect import Learning
from .learning.places import placed_corrections
from .search.greedy_search import GreedySearch
from .search.refit import Refit, as_refit, refit
from .search.score_test import scores
from .search.screening import explaining_most
from .search.trial_fits import polish
from .validation.bands import excess_of, guilty_bands
from .validation.cross_sample import carried_over
from .validation.held_out_misfit import unforeseen
from .validation.improvement import LeastSquares
from .validation.residual_summary import in_words, remainder
from .validation.whole_device import whole_device

_CUT_SHORT = "The search ended at its budget of evaluations: combinations of effects that explain more may exist."
_OF_A_RING = "The device is a ring, and effects may stand for its lateral modes: diagnose it with --fitter stack2d."
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
    refuse_impossible: bool = False,
) -> Diagnosis:
    """Diagnose where recordings and model differ, which physics is missing, and what cannot be decided.

    `effects` names the catalogue effects to consider; None considers all. `hold_out` is one of `held_out.KINDS`: the
    data reserved for validation. `others` are further samples by name, on which the findings are tested. `learn`:
    whether to look for a law of what no effect of the catalogue explains. `known` are effects at the terminals that all
    samples of the bench have: they are part of every hypothesis. `jobs`: number of processes that fit hypotheses at the
    same time; the result does not depend on it. `fitter`: whose model is diagnosed, in place of the stack; effects
    inside of a device are no candidates then, and laws are not learned. `refuse_impossible`: whether an effect of
    `effects` without a place in the build is refused, rather than left out as for one of many samples. Raises FitError
    if the recordings cannot be fitted or contain no such data to hold out, TaskError for effects that the model cannot
    have.
    """
    wanted = _Wanted(
        _possible(effects, fitter),
        progress,
        hold_out,
        others or {},
        learn and fitter is None,
        tuple(known),
        jobs,
        fitter,
        refuse_impossible,
    )
    try:
        with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # a warning is no answer for a user
            return _diagnosed(task, wanted)
    except np.linalg.LinAlgError as error:
        raise FitError(
            f"the recordings cannot be diagnosed: the equations of a fit have no solution ({error}); check the "
            "units and dimensions of the build"
        ) from error


def _diagnosed(task: FitTask, wanted: "_Wanted") -> Diagnosis:
    """Return the diagnosis. Raises the same errors, and LinAlgError."""
    began = time.perf_counter()
    progress, fitter = wanted.progress, wanted.fitter
    progress("checking the data")
    gated = gate(task.sweeps)
    progress("fitting without effects")
    task = replace(task, sweeps=gated.sweeps)
    problem, choice = _posed(Problem.posed(task, progress, fitter, wanted.hold_out), wanted)
    if wanted.refuse_impossible:
        _refuse_impossible(wanted, choice, problem.steps)
    search = _search(problem, choice, wanted)
    bare = search.begin()
    disk = _FiniteDiameter(task, wanted, problem, search, bare) if _may_show_its_rim(task, fitter, choice) else None
    if disk is not None and (early := disk.before_all_else()) is not None:
        return disk.diagnosed(early, gated, began)
    search.run()
    found = conclude(search)
    if disk is not None and found.something_left and (late := disk.beside(found.final)) is not None:
        return disk.diagnosed(late, gated, began)
    return _told(search, choice, found, gated, wanted, began)


@dataclass(frozen=True, eq=False)
class _Wanted:
    """What a diagnosis is asked for; see `diagnose`."""

    effects: tuple[str, ...] | None
    progress: Callable[[str], None]
    hold_out: str
    others: Mapping[str, FitTask]
    learn: bool
    known: tuple[BenchEffect, ...]
    jobs: int
    fitter: Diagnosable | None
    refuse_impossible: bool


def _posed(bare: Problem, wanted: _Wanted) -> tuple[Problem, tuple[Candidate, ...]]:
    """Return the problem with the effects that all samples of the bench have, and the candidates beside them."""
    problem, taken = with_bench_effects(bare, wanted.known), {one.name for one in wanted.known}
    return problem, tuple(one for one in candidates(problem, wanted.effects) if one.effect.name not in taken)


def _search(problem: Problem, choice: tuple[Candidate, ...], wanted: _Wanted) -> GreedySearch:
    """Return the search for effects, which begins with those that the model was fitted with."""
    given = problem.model.seeds if isinstance(problem.model, FittedModel) else ()
    widest = {(one.effect.name, one.where): one for one in sorted(choice, key=lambda one: len(one.steps))}.values()
    found = [(tuple(one for one in widest if (one.effect.name, one.where) in s.names), s.values) for s in given]
    seeds = tuple((effects, values) for effects, values in found if effects)
    return GreedySearch(problem, (*choice, *flaws(problem)), seeds, progress=wanted.progress, jobs=wanted.jobs)


def _may_show_its_rim(task: FitTask, fitter: Diagnosable | None, choice: Sequence[Candidate]) -> bool:
    """Return whether a plate is diagnosed whose finite diameter nothing else has in it yet."""
    stated_none = task.build is not None and not task.build.effects
    return fitter is None and stated_none and any(one.effect.name == lateral.NAME for one in choice)


@dataclass(eq=False)
class _FiniteDiameter:
    """The disk of finite diameter that may have been recorded in place of the plate that is diagnosed."""

    task: FitTask
    wanted: _Wanted
    problem: Problem
    search: GreedySearch
    bare: Hypothesis
    """The plate without effects."""
    _tried: tuple[lateral.DiskTried | None, ...] = ()
    """The disk as tried before all else, if that was done."""

    @property
    def null(self) -> Refit:
        """The plate without effects."""
        return as_refit(self.problem, self.bare)

    def before_all_else(self) -> lateral.FiniteDisk | None:
        """Return the disk if a plate leaves so much, and the disk so little, that no plate needs to be looked for.

        By the bare disk's own recordings: in a joint fit what is wrong with the glue spreads to the disk's residual.
        """
        alone, wanted = lateral.bare_alone(self.task), self.wanted
        if alone is None:
            return None
        problem, search, bare = self.problem, self.search, self.bare
        if len(alone.sweeps) < len(self.task.sweeps):
            problem, choice = _posed(Problem.posed(alone, wanted.progress, None, wanted.hold_out), wanted)
            search = _search(problem, choice, wanted)
            bare = search.begin()
        null = as_refit(problem, bare)
        if not lateral.shows_early(alone, null) or _an_effect_may_do(search, bare):
            return None
        if not lateral.shows_early(alone, _plate_behind_wires(problem, search, null)):
            return None
        made = lateral.tried(alone, null, None, wanted.progress, wanted.jobs)
        self._tried = (made,)
        sure = made is not None and lateral.leaves_no_other(made, null)
        return lateral.finite(made, alone, null, null) if made is not None and sure else None

    def beside(self, final: Hypothesis) -> lateral.FiniteDisk | None:
        """Return the disk if it is more probable than the best plate."""
        null, wanted, best = self.null, self.wanted, as_refit(self.problem, final)
        early = self._tried
        if not early and lateral.may_be_left(self.task, final.unexplained):
            early = (lateral.tried(self.task, null, best, wanted.progress, wanted.jobs),)
        made = early[0] if early else None
        return None if made is None else lateral.finite(made, self.task, null, best)

    def diagnosed(self, wide: lateral.FiniteDisk, gated: Gated, began: float) -> Diagnosis:
        """Return the diagnosis of the disk, with its finite diameter as the first finding."""
        wanted = self.wanted
        problem, choice = _posed(Problem.of_model(wide.tried.model, wanted.hold_out), wanted)
        search = _search(problem, choice, wanted)
        if wide.tried.leaves_much and not search.seeds:
            candidates = explaining_most(problem, search.begin(), search.candidates, wanted.jobs)
            search = replace(search, candidates=candidates)
        elif wide.tried.with_a_dot:
            begun = {one for effects, _ in search.seeds for one in effects}
            possible = (one for one in search.candidates if one in begun or one.effect.of_laws)
            search = replace(search, candidates=tuple(possible))
        search.run()
        modelled, found = replace(wanted, learn=False, others={}, fitter=Disk2DFitter()), conclude(search)
        said = _told(search, choice, found, gated, modelled, began)
        left_out: tuple[str, ...] = ()
        try:
            glued = glued_model(self.task, wide.tried, problem, found.final, wanted.progress)
            said = said if glued is None else together(said, self._of_glued(glued, gated, began))
        except UNCOMPUTABLE as error:
            left_out = (f"What was glued to the disk is not diagnosed: {error}.",)
        null = LeastSquares.of(self.problem, self.bare)
        rim = lateral.finding_of(wide, null.fit, null.held_out, said.final)
        findings = [*(one for one in said.findings if not _of_the_disk(one)), rim]
        findings += lateral.beside(wide, [one for one in said.findings if _of_the_disk(one)])
        verdict = verdict_with(gated, _beside_the_rim(said.verdict))
        before = curves_of(null.fit.objective, null.fit.descent.x, null.fit.descent.x)
        return replace(
            said,
            verdict=verdict,
            baseline=_baseline(self.problem, null, self.bare),
            findings=tuple(findings),
            says=(*_says(verdict, findings, said.remaining), *left_out, *([_NOT_CARRIED] if wanted.others else [])),
            before=before,
            after=lateral.curves(said.after, before),
        )

    def _of_glued(self, glued: StackUnderDiagnosis, gated: Gated, began: float) -> Diagnosis:
        """Return the diagnosis of the glued steps, on the disk that is known.

        Much is left where a bond is open: only what promises to explain most of it is tried then.
        """
        wanted = replace(self.wanted, learn=False, others={}, fitter=Stack2DFitter())
        problem, choice = _posed(Problem.of_model(glued, wanted.hold_out), wanted)
        search = _search(problem, choice, wanted)
        begun = {one for effects, _ in search.seeds for one in effects}
        promising = set(explaining_most(problem, search.begin(), search.candidates, wanted.jobs))
        search = replace(search, candidates=tuple(one for one in search.candidates if one in begun | promising))
        search.run()
        found = conclude(search)
        said = _told(search, choice, found, gated, wanted, began)
        return replace(said, after=curves_at_every_point(self.task, problem, found.final))


def _an_effect_may_do(search: GreedySearch, bare: Hypothesis) -> bool:
    """Return whether some effect promises to explain most of the plate's misfit, as none does of a rim's.

    But a resonance does, where the band is so narrow that it shows one overtone of a rim.
    """
    others = [one for one in search.candidates if one.effect.name != lateral.NAME and not one.resonates]
    return bool(explaining_most(search.problem, bare, others, search.jobs))


def _plate_behind_wires(problem: Problem, search: GreedySearch, null: Refit) -> Refit:
    """Return the plate with the effects at its terminals that explain most, by least squares, one after the other.

    A wire changes a plate as much as a rim does, and a disk whose tensor hardly couples thickness and plane is a plate.
    """
    best = null
    for _ in range(BEHIND_WIRES):
        starts = (best.values, {**best.values, **problem.values})
        rough = [
            refit(problem, (*best.effects, one), values, one.effect_parameters[0].null)
            for one in search.candidates
            if one.where == TERMINALS and one.effect_parameters and one not in best.effects
            for values in starts
        ]
        fits = [polish(problem, refit(problem, one.effects, one.values, None)) for one in rough]
        best = min((best, *fits), key=lambda one: one.chi2_per_dof)
    return best


def _baseline(problem: Problem, fit: LeastSquares, null: Hypothesis) -> FitSummary:
    """Return the fit without effects, with the constants of the hypothesis that there are none."""
    return FitSummary(fit.chi2_per_dof, fit.held_out, by_source(problem, null, constants_of(problem, null)))


def _of_the_disk(one: Finding) -> bool:
    return not (one.effect == UNKNOWN and one.where != ANY)


def _beside_the_rim(verdict: Verdict) -> Verdict:
    """Return the verdict on a plate whose finite diameter has been found, given that on the disk."""
    if verdict == "no-mismatch":
        return "explained"
    return "partly-explained" if verdict == "unexplained" else verdict


def _told(
    search: GreedySearch,
    choice: tuple[Candidate, ...],
    found: Conclusion,
    gated: Gated,
    wanted: _Wanted,
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
        baseline=_baseline(problem, before, found.null),
        final=FitSummary(after.chi2_per_dof, after.held_out, constants),
        findings=tuple(findings),
        not_decidable=not_decidable(final, remaining, constants, {one.effect for one in findings}),
        leftover=left,
        says=(
            *_says(verdict, findings, found.remaining),
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
            "mason, stack2d, radial, disk, disk2d and bvd can"
        )
    return fitter


def _possible(effects: Iterable[str] | None, fitter: Diagnosable | None) -> tuple[str, ...] | None:
    """Return the effects to consider. Raises TaskError for one that acts inside a stack, if the model is none."""
    named = None if effects is None else tuple(effects)
    if fitter is None or named is None:
        return named
    lawful, loads = getattr(fitter, "has_laws", False), getattr(fitter, "loads", ())
    outside = [
        one.name
        for one in every_effect()
        if one.outside or (one.of_laws and lawful) or (one.lies_on_faces is not None and one.lies_on_faces in loads)
    ]
    for name in named:
        if name not in outside:
            raise TaskError(
                f"effect {name!r} acts in the layers of a stack, which the model of `{fitter.name}` is not; it can "
                f"have {', '.join(outside)}"
            )
    return named


def _refuse_impossible(wanted: _Wanted, choice: Sequence[Candidate], steps: Sequence[str]) -> None:
    """Raise TaskError if an effect that was asked for has no place in these steps, or is there already."""
    tested = {POLARITY, *(one.effect.name for one in choice), *(one.name for one in wanted.known)}
    for name in wanted.effects or ():
        if name not in tested:
            raise TaskError(
                f"effect {name!r} cannot be tested here: step {', '.join(steps)} has no place for it, or the build "
                f"states it already; `pzctl effects` lists the places"
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


def _says(verdict: Verdict, findings: Sequence[Finding], remaining: Remaining | None) -> tuple[str, ...]:
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
