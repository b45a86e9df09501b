"""Uncertainties of the constants of a diagnosis by source: noise, instrument, model and dimensions."""

from collections.abc import Mapping
from dataclasses import replace
from math import sqrt

from ...interface import Constant
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Problem
from .effect_size import covariances_of


def by_source(
    problem: Problem, one: Hypothesis, constants: Mapping[str, Constant], coarseness: float = 1.0
) -> dict[str, Constant]:
    """Return the constants of a hypothesis with the parts of their uncertainties.

    What an uncertainty has beyond these parts, because other hypotheses may be right, is of the model. For `coarseness`
    see `covariance_of`.
    """
    names = one.objective.coordinates.parameters
    parts = {
        source: problem.model.constants(problem.steps, one.told.values, names, covariance)
        for source, covariance in covariances_of(one, coarseness).items()
    }
    return {
        name: replace(
            own,
            u_by=_adding_up(own.u_re, {source: its[name].u_re for source, its in parts.items()}),
            u_by_im=_adding_up(own.u_im, {source: its[name].u_im for source, its in parts.items()}),
        )
        for name, own in constants.items()
    }


def _adding_up(u: float | None, parts: Mapping[str, float | None]) -> dict[str, float] | None:
    """Return parts whose squares add up to that of an uncertainty; None if there is none, or nothing known of it."""
    squares = {source: (part or 0.0) ** 2 for source, part in parts.items()}
    whole = sum(squares.values())
    if not u or whole == 0:
        return None
    squares["model"] += max(0.0, u**2 - whole)
    scale = u**2 / sum(squares.values())
    return {source: sqrt(scale * square) for source, square in squares.items()}
