"""Fitter `mason`: least squares on the 1-D stack with exact derivatives, all gluing steps jointly.

W. P. Mason, Electromechanical Transducers and Wave Filters (1942); the closed form is in `models/stack`.
"""

from collections.abc import Callable
from dataclasses import replace

from ...models.stack import StackError
from ..engine.multi_step_fit import check_task, solve
from ..engine.plausibility import doubts, refuse_degenerate
from ..interface import FitError, FitResult, FitTask
from ..uncertainty.fit_result import least_squares_answer
from .coupling import solve_coupling
from .wiring import wiring_doubts

_COUPLED = (
    "The objective kt2 determines c33D and kt from the critical frequencies; h33 and eps33S separately, and all "
    "other free constants, depend on their priors."
)


class Mason:
    """Least squares on the 1-D stack: noise-weighted, all steps jointly, with standard uncertainties."""

    name = "mason"
    version = "1"
    summary = "least squares on the 1-D stack, all steps jointly, with standard uncertainties (default)"
    takes_options = True

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the constants of all layers to all steps at once.

        Raises FitError if the recordings show no resonance pair, are degenerate, or do not belong to the build.
        """
        build, sweeps = check_task(task)
        refuse_degenerate(build, sweeps)
        coupled = task.options.objective == "kt2"
        solution = solve_coupling(task, progress) if coupled else solve(task, progress)
        try:
            answer = least_squares_answer(self.name, self.version, solution, task.options)
        except StackError as error:
            raise FitError(
                f"the fit ended where there is no such device ({error}); check that each recording is of its step, and "
                "the layers of the build"
            ) from error
        rewired = () if coupled else wiring_doubts(task, answer.rms_log_error)
        doubted = rewired or doubts(build, sweeps, answer.constants, answer.derived, answer.rms_log_error)
        return replace(answer, says=(*doubted, *answer.says, *((_COUPLED,) if coupled else ())))
