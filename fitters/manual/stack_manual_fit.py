"""Manual fit of the stack of `mason`: all steps jointly, and every effect of the catalogue."""

from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from ..diagnosis.hypotheses.candidates import candidates
from ..diagnosis.hypotheses.conditions import as_devices
from ..diagnosis.hypotheses.model_under_diagnosis import LayeredModel
from ..diagnosis.hypotheses.problem import Candidate, Problem
from ..engine.descent import Descent
from ..engine.multi_step_fit import Solution, check_task
from ..engine.noise import noise_of
from ..engine.parameters.assembly import nominal_parameters, priors_of, recordings_of
from ..engine.parameters.coordinates import Coordinates
from ..engine.recording import Prior, Recording
from ..interface import FitResult, FitTask
from ..uncertainty.fit_result import least_squares_answer
from ..user_effects import every_effect
from .manual_choices import NAME, Kept


class StackManualFit:
    """The gluing steps of a build, each a stack. A `Subject`."""

    fitter = "mason"
    usual = parts = ((0.0, np.inf),)
    says: tuple[str, ...] = ()

    def __init__(self, task: FitTask) -> None:
        """Prepare the steps. Raises FitError if task, build and sweeps do not match."""
        self.build, self.sweeps = check_task(task)
        noise_by_step = {step: noise_of(sweeps) for step, sweeps in self.sweeps.items()}
        self.noises = {step: sigmas for step, (_, sigmas) in noise_by_step.items()}
        self._noise = {step: noise for step, (noise, _) in noise_by_step.items()}
        self.values = nominal_parameters(self.build)

    def pose(self, kept: Kept) -> "_StackFitSetup":
        """Return the fit of the selected recordings."""
        recordings = [
            recording
            for step, pairs in kept.items()
            for recording in recordings_of(self.build, step, *zip(*pairs, strict=True))
        ]
        priors = priors_of(self.build, kept)
        problem = Problem(LayeredModel(self.build, None), as_devices(recordings), priors, self.values)
        return _StackFitSetup(problem, priors)

    def answer(self, steps: Sequence[str], descent: Descent, seconds: float) -> FitResult:
        """Return the result of a fit over these steps."""
        begun, _ = descent.objective.coordinates.forward(descent.start)
        noises = {step: self._noise[step] for step in steps}
        solution = Solution(self.build, noises, descent, begun, descent.evaluations, seconds)
        return least_squares_answer(NAME, "1", solution)


class _StackFitSetup:
    def __init__(self, problem: Problem, priors: tuple[Prior, ...]) -> None:
        self._problem = problem
        self.recordings: tuple[Recording, ...] = problem.recordings
        self.priors = priors

    def places(self, names: Iterable[str] | None = None) -> tuple[Candidate, ...]:
        everything = (effect.name for effect in every_effect())  # by hand, also what no diagnosis looks for unnamed
        return candidates(self._problem, everything if names is None else names)

    def with_effects(self, effects: Sequence[Candidate]) -> tuple[Recording, ...]:
        return self._problem.with_effects(effects)

    def coordinates(
        self, effects: Sequence[Candidate], values: Mapping[str, float], free: tuple[str, ...] | None
    ) -> Coordinates:
        whole = self._problem.coordinates(effects, values)
        return Coordinates(whole.blocks, values, whole.free if free is None else free)
