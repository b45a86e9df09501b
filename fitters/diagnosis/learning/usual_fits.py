"""Fits in which a fixture errs by no more than a fixture does.

Where much is left, a residual of the fixture of many times its usual size can absorb it: the constants move to where
the device is so sensitive that a few nanohenries describe anything. Such a fit is no explanation, and no law would be
learned beside it.
"""

from collections.abc import Collection, Mapping, Sequence

import numpy as np

from ...error_model.error_sizes import ErrorSizes
from ..decision_rules import TOLERATED
from ..hypotheses.hypothesis import Hypothesis, fitted
from ..hypotheses.problem import Candidate, Problem


def usually_fitted(
    problem: Problem,
    effects: Sequence[Candidate],
    values: Mapping[str, float],
    starts: Sequence[ErrorSizes] = (ErrorSizes(),),
    *,
    near: bool = True,
    rounds: int = 3,
    barred: Collection[str] = ("tau",),
) -> Hypothesis:
    """Return the fit of a hypothesis; without any residual of the fixture, if it would be more than a usual one.

    The arguments are those of `fitted`.
    """
    made = fitted(problem, effects, values, starts, near=near, rounds=rounds, barred=barred)
    if has_usual_fixture(made):
        return made
    return fitted(problem, effects, values, starts, near=near, rounds=rounds, barred=(*barred, "fixture"))


def has_usual_fixture(one: Hypothesis) -> bool:
    """Return whether the residual of the fixture is at most `TOLERATED` times what is usual, as rms of its parts."""
    squares, count = one.fit.deviations.get("fixture", (0.0, 1))
    return float(np.sqrt(squares / count)) <= TOLERATED
