"""Experiment design: simulate every sweep that the instrument can make, and choose those that separate explanations.

A rival explanation fits the recordings as well as the accepted one, but predicts something else for a new measurement.
The value of that measurement is the chi2 that remains after the rival has been adjusted as far as the recordings allow.
A. C. Atkinson and V. V. Fedorov, Biometrika 62 (1975) 57 (T-optimal discrimination), linearised in the adjustment.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ....models.base.arrays import Reals
from ....models.base.model import Model
from ....models.build import Build
from ....models.effects import Conditions, Device
from ....models.effects.base.effect import Stage
from ....models.sweep import Sweep
from ...engine.multi_step_fit import solve
from ...engine.objective import Objective
from ...engine.recording import Recording
from ...interface import FitTask
from ..data_quality.data_gates import gate
from ..findings import Diagnosis
from ..hypotheses.candidates import candidates
from ..hypotheses.conditions import conditions_of
from ..hypotheses.instrument_artefacts import ANY, UNKNOWN
from ..hypotheses.problem import Candidate, Problem
from ..search.refit import Refit, refit
from ..search.trial_fits import resoftened
from .candidate_sweeps import Experiment, InstrumentLimits, experiments, frequencies, settings_of

TELLS = 100.0
"""chi2 by which a proposed measurement must separate two explanations: ten standard deviations."""
_FLOOR = 1e-4
"""Relative error floor of every model."""
_LIKELY = 0.02
"""Probability from which an alternative is worth a measurement."""
_MOST = 3
"""Largest number of measurements proposed at once."""


@dataclass(frozen=True)
class Question:
    """A rival explanation that the recordings cannot exclude beside the accepted one."""

    effect: str
    where: str
    kind: Literal["instead", "unseen", "seen once"]
    """`instead`: another effect in place of a finding; `unseen`: an effect that the constants absorb; `seen once`: a
    finding that should change with level, pace or time, but was identified by its shape in one recording only."""
    size: str = ""
    """Largest possible size of an unseen effect, in words."""


@dataclass(frozen=True)
class Proposal:
    """A measurement that would decide between explanations."""

    experiment: Experiment
    seconds: float
    decides: tuple[Question, ...]
    separation: float
    """Smallest chi2 by which it separates these questions; 0 where no model predicts it."""


@dataclass(frozen=True, eq=False)
class _Rival:
    question: Question
    objective: Objective
    x: Reals
    frozen: bool = False
    """Whether the rival's effects do not depend on how a sweep runs."""


def proposals(task: FitTask, diagnosis: Diagnosis, instrument: InstrumentLimits) -> tuple[Proposal, ...]:
    """Return the measurements of the last step that would decide the open questions, most decisive first.

    The result is empty if this instrument could decide nothing. Raises FitError if the task cannot be fitted.
    """
    sweeps = gate(task.sweeps).sweeps
    step = list(sweeps)[-1]
    choice = bearable(experiments(sweeps[step], instrument), task.build)
    if diagnosis.verdict in ("unexplained", "partly-explained"):
        return _unexplained(choice, instrument)
    problem = Problem.of(solve(replace(task, sweeps=sweeps), lambda _: None), task.free)
    known = {(one.effect.name, one.where, one.step): one for one in candidates(problem)}
    found = [known[f.effect, f.where, f.step] for f in diagnosis.findings if (f.effect, f.where, f.step) in known]
    accepted = _accepted(problem, diagnosis, found)
    rivals = _renamed(problem, diagnosis, known, accepted)
    rivals += [*_unseen(problem, diagnosis, known, accepted), *_seen_once(problem, step, accepted)]
    tried = [(one, [_separation(one, step, accepted, rival, instrument) for rival in rivals]) for one in choice]
    return _chosen(tried, rivals, instrument)


def bearable(choice: Sequence[Experiment], build: Build | None) -> tuple[Experiment, ...]:
    """Return the experiments whose level and bias stay within the limits of the build."""
    limits = build.limits if build else None
    return tuple(one for one in choice if limits is None or limits.allows(one.plan))


def _unexplained(choice: Sequence[Experiment], instrument: InstrumentLimits) -> tuple[Proposal, ...]:
    """Return the measurements that tell an effect of the device from one of the sweep, for which no model is needed."""
    telling = [one for one in choice if one.kind in ("direction", "lower level")]
    open_question = (Question(UNKNOWN, ANY, "instead"),)
    return tuple(Proposal(one, instrument.seconds(one.plan), open_question, 0.0) for one in telling)


def _accepted(problem: Problem, diagnosis: Diagnosis, found: Sequence[Candidate]) -> Refit:
    values = dict(problem.values)
    for finding, candidate in zip((f for f in diagnosis.findings if f.effect != "polarity"), found, strict=False):
        own = {candidate.prefix + knob.name for knob in candidate.effect_parameters}
        values |= {
            candidate.prefix + name: size.value
            for name, size in finding.parameters.items()
            if candidate.prefix + name in own
        }
    return _fitted(problem, found, values, None)


def _fitted(problem: Problem, effects: Sequence[Candidate], values: dict[str, float], guess: float | None) -> Refit:
    """Return a fit whose recordings are weighted by their own misfit."""
    rough = refit(problem, effects, values, guess)
    return refit(resoftened(problem, rough), effects, rough.values, None, tolerance=1e-6)


def _renamed(
    problem: Problem, diagnosis: Diagnosis, known: dict[tuple[str, str, str], Candidate], accepted: Refit
) -> list[_Rival]:
    """Return the explanations in which an alternative takes the place of a finding."""
    made: list[_Rival] = []
    for finding in diagnosis.findings:
        rest = tuple(one for one in accepted.effects if (one.effect.name, one.where) != (finding.effect, finding.where))
        for other in finding.alternatives:
            candidate = known.get((other.effect, other.where, finding.step))
            if other.probability < _LIKELY or candidate is None or not candidate.effect_parameters:
                continue
            fitted = _fitted(problem, (*rest, candidate), accepted.values, candidate.effect_parameters[0].typical)
            question = Question(other.effect, other.where, "instead")
            made.append(_Rival(question, fitted.objective, fitted.descent.x))
    return made


def _unseen(
    problem: Problem, diagnosis: Diagnosis, known: dict[tuple[str, str, str], Candidate], accepted: Refit
) -> list[_Rival]:
    """Return the explanations in which an undetectable effect has its largest possible size."""
    made: list[_Rival] = []
    for entry in diagnosis.not_decidable:
        candidate = next((c for key, c in known.items() if key[:2] == (entry.effect, entry.where)), None)
        if candidate is None or not candidate.effect_parameters:
            continue
        knob = candidate.effect_parameters[0]
        limit = entry.upper_limit.get(knob.name)
        if limit is None or knob.typical <= 0:
            continue
        held = {one.name: one.null for one in candidate.effect_parameters} | {knob.name: limit.value}
        with_it = replace(problem, recordings=tuple(_holding(one, candidate, held) for one in problem.recordings))
        fitted = _fitted(with_it, accepted.effects, accepted.values, None)
        question = Question(entry.effect, entry.where, "unseen", f"{limit.value:.2g} {limit.unit}".removesuffix(" 1"))
        made.append(_Rival(question, fitted.objective, fitted.descent.x))
    return made


def _seen_once(problem: Problem, step: str, accepted: Refit) -> list[_Rival]:
    """Return the doubts about acquisition effects that only one way of sweeping has shown.

    Such a rival describes the recordings exactly as well, but with an effect that does not depend on the sweep.
    """
    ran = [one.model.conditions for one in problem.recordings if one.step == step and isinstance(one.model, Device)]
    alike = len({(one.level_V, one.direction, round(one.pace, 6)) for one in ran}) == 1
    return [
        _Rival(Question(one.effect.name, one.where, "seen once"), accepted.objective, accepted.descent.x, frozen=True)
        for one in accepted.effects
        if one.effect.stage == Stage.ACQUISITION and step in one.steps and alike
    ]


def _holding(recording: Recording, candidate: Candidate, values: dict[str, float]) -> Recording:
    device = recording.model
    if recording.step not in candidate.steps or not isinstance(device, Device):
        return recording
    return replace(recording, model=device.with_effect(candidate.effect, candidate.where, values))


def _separation(one: Experiment, step: str, accepted: Refit, rival: _Rival, instrument: InstrumentLimits) -> float:
    """Return the chi2 by which a measurement would contradict a rival if the accepted explanation were true."""
    f = frequencies(one.plan)
    own = [k for k, recording in enumerate(accepted.objective.recordings) if recording.step == step]
    before = [accepted.objective.recordings[k].sweep for k in own]
    settings = settings_of(one.plan) | {"estimated_seconds": instrument.seconds(one.plan)}
    ran = conditions_of([*before, Sweep(f, np.ones_like(f, complex), settings)])[-1]
    expected = _under(accepted.objective.models(accepted.descent.x)[own[0]], ran).impedance(f)
    sigma = np.hypot(instrument.noise(one.plan, f, expected), _FLOOR)
    template = rival.objective.recordings[own[0]]
    model = template.model if rival.frozen else _under(template.model, ran)
    recording = Recording(step, Sweep(f, expected), model, sigma, renamed=template.renamed)
    seen = Objective([recording], rival.objective.coordinates, ())
    n = 2 * f.size
    d, J_new = seen.residual(rival.x)[:n], seen.jacobian(rival.x)[:n]
    J_old = rival.objective.jacobian(rival.x)
    J = np.vstack([J_new, J_old])
    r = np.concatenate([d, np.zeros(J_old.shape[0])])
    scale = 1 / np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    bend: Reals = np.asarray(np.linalg.lstsq(J * scale, -r, rcond=1e-12)[0], np.float64)
    return float(np.sum((r + (J * scale) @ bend) ** 2))


def _under(device: Model, ran: Conditions) -> Model:
    return replace(device, conditions=ran) if isinstance(device, Device) else device


def _chosen(
    tried: Sequence[tuple[Experiment, list[float]]], rivals: Sequence[_Rival], instrument: InstrumentLimits
) -> tuple[Proposal, ...]:
    """Return the fewest measurements that decide all decidable questions; among equally decisive ones the shortest."""
    left = set(range(len(rivals)))
    made: list[Proposal] = []
    while left and tried and len(made) < _MOST:
        worth = [sum(separations[k] > TELLS for k in left) for _, separations in tried]
        seconds = [instrument.seconds(one.plan) for one, _ in tried]
        best = max(zip(worth, (-s for s in seconds), range(len(tried)), strict=True))[2]
        if not worth[best]:
            break
        one, separations = tried[best]
        decided = [k for k in sorted(left) if separations[k] > TELLS]
        questions = tuple(rivals[k].question for k in decided)
        made.append(Proposal(one, seconds[best], questions, min(separations[k] for k in decided)))
        left -= set(decided)
    return tuple(made)
