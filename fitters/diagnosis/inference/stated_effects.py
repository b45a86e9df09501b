"""Findings in the form of a build's effects, so that a fit includes them in its model."""

from collections.abc import Sequence

from ....models.build import EffectSpec, Quantity
from ....models.effects import Stage
from ....models.effects.learned.learned import NAME as LEARNED
from ....models.effects.learned.learned import LearnedLaw
from ....models.effects.learned.user_law import UserLaw
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.instrument_artefacts import UNKNOWN
from ..hypotheses.problem import Problem
from .conclusion import NamedEffect
from .effect_size import parameters_of
from .finite_diameter import NAME as FINITE_DIAMETER


def stated(
    problem: Problem, final: Hypothesis, named: Sequence[NamedEffect], coarseness: float
) -> tuple[EffectSpec, ...]:
    """Return the named effects that belong to the sample, without effects of a sweep.

    Laws at the same place are in the order in which they act, which is also that of a build's sections.
    """
    own = sorted(filter(_belongs_to_the_sample, named), key=lambda one: one.candidate.effect.number)
    return tuple(_stated(problem, final, one, coarseness) for one in own)


def _belongs_to_the_sample(named: NamedEffect) -> bool:
    effect = named.candidate.effect
    return (
        named.kind == "finding" and effect.name not in (UNKNOWN, FINITE_DIAMETER) and effect.stage != Stage.ACQUISITION
    )


def _stated(problem: Problem, final: Hypothesis, named: NamedEffect, coarseness: float) -> EffectSpec:
    one = named.candidate
    sizes = parameters_of(one, final, coarseness)
    law = one.effect if isinstance(one.effect, LearnedLaw | UserLaw) else None
    return EffectSpec(
        effect=LEARNED if law else one.effect.name,  # a build is complete without the user's catalogue
        where=one.where,
        values={
            knob.name: Quantity(sizes[knob.name].value, u=sizes[knob.name].u, source="diagnosis")
            for knob in one.effect_parameters
        },
        steps=() if one.steps == problem.steps else one.steps,
        quantity=law.place.quantity if law else "",
        law=law.law.name if law else "",
        reference=law.reference if law else 0.0,
    )
