"""Errors at places of their own that a recording shows: weak lines of the device, switches of the analyzer's range."""

from dataclasses import replace

from ...error_model.local_error_kinds import WeakLine
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Problem
from .range_switches import range_switches
from .weak_lines import WEAK, weak_lines


def with_local_errors(problem: Problem, parent: Hypothesis) -> Problem:
    """Return the problem whose error model has the local errors that a hypothesis leaves; itself if it has them."""
    switches = range_switches(parent)
    local = (*weak_lines(parent, switches), *switches)
    return problem if set(local) == set(problem.local) else replace(problem, local=local)


def without_strong_lines(problem: Problem, parent: Hypothesis) -> Problem:
    """Return the problem without weak lines if one of them is none in the fit of a hypothesis beside them.

    Its height is estimated to first order, before the constants are fitted with it; a further resonance at that of the
    device itself shifts it, and then becomes higher. The other lines were found beside it and may be its remnants.
    """
    if max(parent.fit.line_heights.values(), default=0.0) <= WEAK:
        return problem
    return replace(problem, local=tuple(one for one in problem.local if not isinstance(one, WeakLine)))
