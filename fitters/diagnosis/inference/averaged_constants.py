"""Uncertainties of constants that count which effects are present is not certain, either."""

from collections.abc import Sequence
from dataclasses import replace
from math import sqrt

from ...interface import Constant
from ..hypotheses.hypothesis import Hypothesis, probabilities
from ..hypotheses.problem import Problem
from .effect_size import constants_of

_NEGLIGIBLE = 1e-4
"""Probability below which a hypothesis is left out: it would shift a constant by a hundred standard uncertainties
before it added as much as one."""


def averaged_constants(
    problem: Problem, final: Hypothesis, ranked: Sequence[Hypothesis], coarseness: float = 1.0
) -> dict[str, Constant]:
    """Return the constants of the final hypothesis, with the spread of the posterior of all hypotheses around them.

    The law of total variance (Hoeting et al., Statist. Sci. 14 (1999) 382): the mean of u^2 over all hypotheses, and
    the mean square of how far their constants lie from the final ones. For `coarseness` see `covariance_of`.
    """
    own = constants_of(problem, final, coarseness)
    if final.key not in {one.key for one in ranked}:  # a learned law replaces all of them
        return own
    pairs = zip(ranked, probabilities(ranked).tolist(), strict=True)
    likely = [(one, part) for one, part in pairs if part > _NEGLIGIBLE]
    whole = sum(part for _, part in likely)
    every = [(part / whole, own if one is final else constants_of(problem, one, coarseness)) for one, part in likely]
    return {
        name: replace(
            one,
            u_re=_spread(one.re, one.u_re, [(part, its[name].re, its[name].u_re) for part, its in every]),
            u_im=_spread(one.im, one.u_im, [(part, its[name].im, its[name].u_im) for part, its in every]),
        )
        for name, one in own.items()
    }


def _spread(value: float, u: float | None, every: Sequence[tuple[float, float, float | None]]) -> float | None:
    """Return the root mean square distance from a value; `u` itself if the value is held."""
    if not u:
        return u
    return sqrt(sum(part * ((its or 0.0) ** 2 + (there - value) ** 2) for part, there, its in every))
