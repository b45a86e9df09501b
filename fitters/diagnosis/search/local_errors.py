"""Errors at places of their own that a recording shows: weak lines of the device, switches of the analyzer's range."""

from dataclasses import replace

from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Problem
from .range_switches import range_switches
from .weak_lines import weak_lines


def with_local_errors(problem: Problem, parent: Hypothesis) -> Problem:
    """Return the problem whose error model has the local errors that a hypothesis leaves; itself if it has them."""
    switches = range_switches(parent)
    local = (*weak_lines(parent, switches), *switches)
    return problem if set(local) == set(problem.local) else replace(problem, local=local)
