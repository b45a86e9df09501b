"""Fitter `mason`: least squares on the 1-D stack with exact derivatives, all gluing steps jointly.

W. P. Mason, Electromechanical Transducers and Wave Filters (1942); the closed form is in `models/stack`.
"""

from collections.abc import Callable

from .answer import least_squares_answer
from .interface import FitResult, FitTask
from .joint import solve


class Mason:
    """Least squares on the 1-D stack: noise-weighted, all steps jointly, with standard uncertainties."""

    name = "mason"
    version = "1"
    summary = "least squares on the 1-D stack, all steps jointly, with standard uncertainties (default)"
    takes_options = True

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the constants of all layers to all steps at once.

        Raises FitError where the recordings show no resonance pair or do not belong to the build.
        """
        return least_squares_answer(self.name, self.version, solve(task, progress), task.options)
