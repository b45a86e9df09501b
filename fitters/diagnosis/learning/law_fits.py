"""Fits of causal, passive laws in addition to a hypothesis, and their probabilities."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ....models.effects.learned.corrections import Place
from ....models.effects.learned.laws import Law
from ....models.effects.learned.learned import LearnedLaw
from ....models.effects.learned.sweep_laws import SweepLaw, laws_of_sweeps
from ...engine.recording import rms
from ...error_model.error_columns import stack_of
from ...error_model.error_sizes import ErrorSizes
from ...interface import UNCOMPUTABLE
from ..hypotheses.candidates import as_set
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem
from .drawn_corrections import PlacedCorrection
from .places import learned_in, number_at
from .usual_fits import usually_fitted


@dataclass(frozen=True, eq=False)
class LearnedCorrection:
    """A law fitted at one place."""

    placed: PlacedCorrection
    effect: LearnedLaw
    candidate: Candidate
    hypothesis: Hypothesis
    probability: float
    """Probability of this law among the laws tried at this place."""

    @property
    def joint(self) -> float:
        """Probability of this place and this law."""
        return self.placed.probability * self.probability


Made = tuple[LearnedLaw, Candidate, Hypothesis]
"""A law, where it acts, and its fit."""


def has_already(problem: Problem, parent: Hypothesis, place: Place, steps: tuple[str, ...], law: Law) -> bool:
    """Return whether these steps have this law already: a second one of the same form is no different law."""
    known = learned_in(problem, parent)
    return any(one.place == place and one.law.name == law.name and not set(steps).isdisjoint(at) for one, at in known)


def law_candidate(
    problem: Problem, parent: Hypothesis, place: Place, steps: tuple[str, ...], law: Law
) -> tuple[LearnedLaw, Candidate]:
    """Return a law as a further effect of these steps, with its frequencies in their recorded band."""
    stack = stack_of(problem.recordings[-1].model)
    number = number_at(problem, parent, place.where)
    if law in laws_of_sweeps(place.quantity):
        swept = SweepLaw(place, law, stack, number)
        return swept, Candidate(swept, place.where, steps, tuple(as_set(problem, knob) for knob in law.parameters))
    ends = [recording.sweep.frequency[[0, -1]] for recording in problem.recordings if recording.step in steps]
    band = min(float(end[0]) for end in ends), max(float(end[1]) for end in ends)
    effect = LearnedLaw(place, law, stack, band=band, number=number)
    return effect, Candidate(effect, place.where, steps, effect.effect_parameters(stack, place.where))


def weighed(placed: PlacedCorrection, made: Sequence[Made]) -> tuple[LearnedCorrection, ...]:
    """Return fitted laws of one place with their probabilities, most probable first."""
    if not made:
        return ()
    evidence = np.array([hypothesis.log_evidence for *_, hypothesis in made])
    temper = max((one for *_, one in made), key=lambda one: one.log_evidence).coarseness
    part = np.exp((evidence - np.max(evidence)) / temper)
    shares = (part / np.sum(part)).tolist()
    found = [LearnedCorrection(placed, *one, share) for one, share in zip(made, shares, strict=True)]
    return tuple(sorted(found, key=lambda one: -one.probability))


Start = tuple[Mapping[str, float], dict[str, float]]
"""Values of the constants, and parameters of the law, from which a fit starts."""


def best_fit(
    problem: Problem, parent: Hypothesis, one: Candidate, starts: Sequence[Start], sizes: Sequence[ErrorSizes]
) -> Hypothesis | None:
    """Return the best fit of a law.

    Each is fitted again from its own end, because its evidence counts only where the errors are linearised.
    """
    made: list[Hypothesis] = []
    effects = (*parent.effects, one)
    for values, start in starts:
        for own in dict.fromkeys(sizes):
            try:
                once = usually_fitted(problem, effects, {**values, **start}, (own,), rounds=4)
                made.append(usually_fitted(problem, effects, once.values, (once.fit.sizes,), rounds=1))
            except UNCOMPUTABLE:
                continue
    return max(made, key=lambda hypothesis: hypothesis.log_evidence, default=None)


def left_by(one: Hypothesis) -> float:
    """Return the rms of ln Z that a model leaves without any errors."""
    return rms(*one.fit.left_by_the_model)
