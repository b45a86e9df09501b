"""The complete diagnosis of a build: data checks, hypotheses, validation, open questions, verdict."""

import time
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.effects.base.effect import TERMINALS
from ..disk.two_d.disk2d import Disk2DFitter
from ..engine.fitted_model import Diagnosable, FittedModel
from ..interface import UNCOMPUTABLE, FitError, FitTask, TaskError
from ..layered.two_d.stack2d import Stack2DFitter
from ..layered.two_d.stack_under_diagnosis import StackUnderDiagnosis
from ..plugins import DEFAULT, load_fitter
from ..uncertainty.fit_result import curves_of
from ..user_effects import every_effect
from .data_quality.data_gates import Gated, gate
from .decision_rules import BEHIND_WIRES
from .diagnosis_report import baseline_of, reported, says_of
from .diagnosis_request import DiagnosisRequest
from .findings import Diagnosis, Finding, Verdict
from .hypotheses.bench_effects import BenchEffect, with_bench_effects
from .hypotheses.candidates import candidates, flaws
from .hypotheses.held_out import BANDS
from .hypotheses.hypothesis import Hypothesis
from .hypotheses.instrument_artefacts import ANY, UNKNOWN
from .hypotheses.problem import Candidate, Problem
from .inference import finite_diameter as lateral
from .inference.conclusion import conclude
from .inference.data_findings import POLARITY, verdict_with
from .inference.glued_steps import curves_at_every_point, glued_model, together
from .search.greedy_search import GreedySearch
from .search.refit import Refit, as_refit, refit
from .search.screening import explaining_most
from .search.trial_fits import polish
from .validation.improvement import LeastSquares

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
    wanted = DiagnosisRequest(
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


def _diagnosed(task: FitTask, wanted: "DiagnosisRequest") -> Diagnosis:
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
    return reported(search, choice, found, gated, wanted, began)


def _posed(bare: Problem, wanted: DiagnosisRequest) -> tuple[Problem, tuple[Candidate, ...]]:
    """Return the problem with the effects that all samples of the bench have, and the candidates beside them."""
    problem, taken = with_bench_effects(bare, wanted.known), {one.name for one in wanted.known}
    return problem, tuple(one for one in candidates(problem, wanted.effects) if one.effect.name not in taken)


def _search(problem: Problem, choice: tuple[Candidate, ...], wanted: DiagnosisRequest) -> GreedySearch:
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
    wanted: DiagnosisRequest
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
        said = reported(search, choice, found, gated, modelled, began)
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
            baseline=baseline_of(self.problem, null, self.bare),
            findings=tuple(findings),
            says=(*says_of(verdict, findings, said.remaining), *left_out, *([_NOT_CARRIED] if wanted.others else [])),
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
        said = reported(search, choice, found, gated, wanted, began)
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


def _of_the_disk(one: Finding) -> bool:
    return not (one.effect == UNKNOWN and one.where != ANY)


def _beside_the_rim(verdict: Verdict) -> Verdict:
    """Return the verdict on a plate whose finite diameter has been found, given that on the disk."""
    if verdict == "no-mismatch":
        return "explained"
    return "partly-explained" if verdict == "unexplained" else verdict


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


def _refuse_impossible(wanted: DiagnosisRequest, choice: Sequence[Candidate], steps: Sequence[str]) -> None:
    """Raise TaskError if an effect that was asked for has no place in these steps, or is there already."""
    tested = {POLARITY, *(one.effect.name for one in choice), *(one.name for one in wanted.known)}
    for name in wanted.effects or ():
        if name not in tested:
            raise TaskError(
                f"effect {name!r} cannot be tested here: step {', '.join(steps)} has no place for it, or the build "
                f"states it already; `pzctl effects` lists the places"
            )
