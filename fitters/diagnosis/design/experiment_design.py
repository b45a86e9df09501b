"""Which further measurement would tell explanations apart: each that the instrument can do is tried in thought first.

An explanation that fits the recordings as well as the accepted one predicts, for a measurement that was not made,
something else; how far off it stays after it has bent as far as the recordings allow says what the measurement is
worth. A. C. Atkinson and V. V. Fedorov, Biometrika 62 (1975) 57 (T-optimal discrimination), linear in the bending.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from ....models.base.arrays import Frequencies, Impedances, Reals
from ....models.base.model import Model
from ....models.build import Build
from ....models.effects import Conditions, Device
from ....models.effects.base.effect import Stage
from ....models.sweep import Sweep
from ....models.sweep_plan import SweepPlan
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
from .candidate_sweeps import Experiment, experiments, frequencies, settings_of

TELLS = 100.0
"""chi2 by which a measurement must tell two explanations apart to be proposed: ten standard deviations."""
_FLOOR = 1e-4
"""Relative error that no model is free of."""
_LIKELY = 0.02
"""Probability from which something else is worth a measurement."""
_MOST = 3
"""Measurements that are proposed at once."""


@dataclass(frozen=True)
class InstrumentLimits:
    """What has to be known of an instrument to plan with it."""

    seconds: Callable[[SweepPlan], float]
    """How long a plan takes."""
    noise: Callable[[SweepPlan, Frequencies, Impedances], Reals]
    """Relative standard deviation of Re and Im of Z from point to point, shape (N,)."""


@dataclass(frozen=True)
class Question:
    """Two explanations that the recordings leave open: the accepted one, and this."""

    effect: str
    where: str
    kind: Literal["instead", "unseen", "seen once"]
    """Another name of what was found; something that the constants absorb; or what was found, known by its shape in one
    recording only, though it should change with level, pace or time."""
    size: str = ""
    """Of something unseen: how large it may be, in words."""


@dataclass(frozen=True)
class Proposal:
    """A measurement that would decide."""

    experiment: Experiment
    seconds: float
    decides: tuple[Question, ...]
    separation: float
    """chi2 by which it tells the worst of these apart; 0 where no model predicts it."""


@dataclass(frozen=True, eq=False)
class _Rival:
    question: Question
    objective: Objective
    x: Reals
    frozen: bool = False
    """Whether it says that nothing depends on how a sweep runs."""


def proposals(task: FitTask, diagnosis: Diagnosis, instrument: InstrumentLimits) -> tuple[Proposal, ...]:
    """Return the measurements of the last step that would decide what a diagnosis leaves open, most telling first.

    None where nothing is open that this instrument could decide. Raises FitError where the task cannot be fitted.
    """
    sweeps = gate(task.sweeps).sweeps
    step = list(sweeps)[-1]
    choice = bearable(experiments(sweeps[step]), task.build)
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
    """Return the experiments that apply no more to the sample than its build allows."""
    limits = build.limits if build else None
    return tuple(one for one in choice if limits is None or limits.allows(one.plan))


def _unexplained(choice: Sequence[Experiment], instrument: InstrumentLimits) -> tuple[Proposal, ...]:
    """Return what tells device from sweep, where no model predicts anything."""
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
    """Return a fit whose recordings weigh what their own misfit lets them."""
    rough = refit(problem, effects, values, guess)
    return refit(resoftened(problem, rough), effects, rough.values, None, tolerance=1e-6)


def _renamed(
    problem: Problem, diagnosis: Diagnosis, known: dict[tuple[str, str, str], Candidate], accepted: Refit
) -> list[_Rival]:
    """Return the explanations in which something else stands in the place of a finding."""
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
    """Return the explanations in which something that may be there unseen is as large as it may be."""
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
    """Return the doubts about effects of the sweep that only one way of sweeping has shown.

    The rival describes the recordings as well, to the last digit; but what it describes does not depend on the sweep.
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
    """Return the chi2 by which a measurement would contradict a rival, were the accepted explanation true."""
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
    """Return the fewest measurements that decide all that can be decided, of those that decide as much the shortest."""
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
