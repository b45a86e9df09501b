"""Fitter `stack2d`: constants of all layers of a glued stack of finite diameter, in two dimensions.

Radial overtones and the edge mode of the whole stack are part of the model (`models/stack2d`), so that neither the
ceramic's losses nor the layers' constants need to compensate for them.
"""

import time
from collections.abc import Callable

from ...engine.fitted_model import FittedModel
from ...interface import FitResult, FitTask
from .stack_problem import NAME, problem_of
from .stack_result import stack_result
from .stack_under_diagnosis import diagnosable_stack
from .stepwise import fitted_stack


class Stack2DFitter:
    """All constants of a round glued stack, in two dimensions: ceramic, glue, matching layers."""

    name = NAME
    version = "1"
    has_laws = True
    summary = "a glued stack of finite diameter in two dimensions: lateral modes of disk, glue and layers together"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the constants of all layers to all steps at once, starting from the one-dimensional answer.

        Raises FitError if no recording lies below 1.5 times the thickness resonance, TaskError for a build that the
        model lacks.
        """
        began = time.perf_counter()
        found = fitted_stack(problem_of(task), progress)
        return stack_result(found, self.version, time.perf_counter() - began)

    def fitted_model(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FittedModel:
        """Return the fitted stack, for a diagnosis. Raises FitError as `fit` does."""
        return diagnosable_stack(problem_of(task), progress)
