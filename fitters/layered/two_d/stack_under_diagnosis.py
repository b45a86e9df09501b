"""A stack in two dimensions as the model of a diagnosis."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ....models.base.arrays import Reals
from ....models.build import EffectSpec, Quantity
from ....models.effects import find_effect
from ....models.effects.base.effect import TERMINALS
from ...disk.planar_result import PLANAR_UNITS
from ...disk.two_d.valley_search import thinned
from ...engine.fitted_model import FittedModel, Seed, without_effects
from ...interface import Constant, FitError, TaskError
from .stack_problem import StackProblem, plate_of
from .stack_result import constants_of_stack
from .stepwise import FittedStack, fitted_stack

_WIRES = {"lead-inductance": ("inductance", "resistance"), "stray-capacitance": ("capacitance",)}
"""Effects at the terminals, with their parameters, that are fitted together with a stack that does not fit alone."""
_DESCRIBED = 2.0
"""chi2 of a point up to which a stack counts as described without them."""
_HOPELESS = 5.0
"""Misfit of the first step over that expected of its noise from which no further step is fitted without them."""
_POINTS = 150
"""Points of each sweep in a diagnosis, which fits a hundred hypotheses."""


@dataclass(frozen=True, eq=False)
class StackUnderDiagnosis(FittedModel):
    """The fitted stack, with the constants that follow from its parameters."""

    found: FittedStack = field(kw_only=True)

    @property
    def problem(self) -> StackProblem:
        """What was fitted."""
        return self.found.problem

    def constants(
        self, steps: Sequence[str], values: Mapping[str, float], names: Sequence[str], covariance: Reals
    ) -> dict[str, Constant]:
        """Return the constants of all layers and all derived ones, with standard uncertainties."""
        own = set(self.descent.objective.coordinates.parameters)
        at = [k for k, name in enumerate(names) if name in own]
        within = covariance[np.ix_(at, at)]
        there = replace(self.found, values={**self.found.values, **values})
        return constants_of_stack(there, tuple(names[k] for k in at), within)


def diagnosable_stack(problem: StackProblem, progress: Callable[[str], None]) -> StackUnderDiagnosis:
    """Return a stack fitted for a diagnosis: alone, and with its wires if it does not fit alone. Raises TaskError.

    The search for the lateral constants cannot succeed if an effect hides them, so the effects take part in it.
    """
    if problem.build.effects:
        return under_diagnosis(fitted_stack(problem, progress), ())
    alone = None
    try:
        alone = fitted_stack(problem, progress, hopeless=_HOPELESS)
        if described(alone):
            return under_diagnosis(alone, ())
    except TaskError:
        raise
    except FitError:
        pass  # the first step needs its wires
    progress("fitting in two dimensions together with its wires")
    build = replace(problem.build, effects=_wires(problem))
    joint = fitted_stack(replace(problem, build=build), progress)
    if alone is not None and _left(joint) > _left(alone):
        return under_diagnosis(alone, ())
    seed = Seed(frozenset((name, TERMINALS) for name in _WIRES), joint.values)
    bare = replace(joint, problem=problem, descent=without_effects(joint.descent, tuple(_WIRES)))
    return under_diagnosis(bare, (seed,))


def under_diagnosis(found: FittedStack, seeds: tuple[Seed, ...], points: int = _POINTS) -> StackUnderDiagnosis:
    """Return a fitted stack as the model of a diagnosis, with about so many points of each sweep."""
    before = found.descent.objective
    few = [thinned(one, points) for one in before.recordings]
    descent = replace(found.descent, objective=before.with_recordings(few))
    scale = plate_of(found.problem, list(found.problem.sweeps)[-1])
    return StackUnderDiagnosis(descent, scale, PLANAR_UNITS, seeds, found=found)


def _wires(problem: StackProblem) -> tuple[EffectSpec, ...]:
    """Return a lead and a stray capacitance as a build states them, of usual sizes and as uncertain as they are."""
    plate = plate_of(problem, next(iter(problem.sweeps)))
    made: list[EffectSpec] = []
    for name, free in _WIRES.items():
        values: dict[str, Quantity] = {}
        for knob in find_effect(name).effect_parameters(plate, TERMINALS):
            size = knob.expected[0]
            values[knob.name] = Quantity(size, u=size) if knob.name in free else Quantity(knob.null)
        made.append(EffectSpec(name, TERMINALS, values=values))
    return tuple(made)


def described(found: FittedStack) -> bool:
    """Return whether a stack describes its recordings about to their noise."""
    return _left(found) < _DESCRIBED


def _left(found: FittedStack) -> float:
    """Return chi2 of all points, over their number."""
    objective = found.descent.objective
    ratios = objective.log_ratios(found.descent.x)
    squares = [np.abs(ratio / one.noise) ** 2 / 2 for one, ratio in zip(objective.recordings, ratios, strict=True)]
    return float(np.mean(np.concatenate(squares)))
