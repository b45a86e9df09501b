"""Fitter `nlopt-global`: the deepest minimum inside physical bounds, independent of any start.

Global algorithms of NLopt minimise an objective with increased noise from the middle of the bounds, one after another
until a minimum describes every recording to its noise; descents from points drawn uniformly within the bounds look for
others; every result is polished by least squares. The search stops when a better minimum is improbable (see
`multistart`).
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from ...models.base.arrays import Reals
from ..engine.descent import Descent, settle
from ..engine.multi_step_fit import Solution, check_task
from ..engine.noise import noise_of
from ..engine.objective import Objective
from ..engine.parameters.assembly import coordinates_of, nominal_parameters, priors_of, recordings_of
from ..engine.parameters.coordinates import Coordinates
from ..engine.plausibility import doubts, refuse_degenerate
from ..engine.recording import Recording, rms
from ..interface import FitError, FitResult, FitTask, Noise
from ..uncertainty.fit_result import least_squares_answer
from .multistart import Multistart, box_of, coarse, costs
from .nlopt_wrapper import Algorithm, search

_ALGORITHMS: tuple[tuple[Algorithm, int], ...] = (
    ("MLSL+LBFGS", 60),
    ("CRS2_LM", 150),
    ("ESCH", 100),
    ("DIRECT_L", 100),
)
# Evaluations per coordinate. A search need not converge, since least squares continues from its result.
_UNSEEN, _BETTER = 0.5, 0.02
_ENOUGH = 12
# Number of descents after which a minimum that describes every recording to its noise is accepted: none can be better.
_POLISHED = 3
_HARMLESS = (".loss", ".q", "back.z", "front.z")
# Coordinates that remain physical for any value.


class NloptGlobal:
    """Global search over physical bounds with NLopt, polished by least squares."""

    name = "nlopt-global"
    version = "1"
    summary = "NLopt's CRS2, ESCH, MLSL, DIRECT and multistart over physical bounds, polished; reports distinct minima"

    def __init__(self, seconds: float = 60.0, seed: int = 1) -> None:
        """`seconds`: time limit of the search; `seed` of all random numbers."""
        self._seconds, self._seed = seconds, seed

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the constants of all layers to all steps at once.

        An exception from `progress` ends the search. Raises FitError if the recordings do not belong to the build.
        """
        began = time.perf_counter()
        build, sweeps = check_task(task)
        refuse_degenerate(build, sweeps)
        noise_by_step = {step: noise_of(of_step) for step, of_step in sweeps.items()}
        noises: Mapping[str, Noise] = {step: noise for step, (noise, _) in noise_by_step.items()}
        recordings = [
            recording
            for step, of_step in sweeps.items()
            for recording in recordings_of(build, step, of_step, noise_by_step[step][1])
        ]
        begun = nominal_parameters(build)
        coordinates, priors = coordinates_of(build, sweeps, begun, task.free), priors_of(build, sweeps)
        if coordinates.x.size == 0:
            raise FitError("nothing is free to be fitted: every constant of the build is taken as exact")
        blunt = Objective(coarse(recordings), coordinates, priors)
        multistart = Multistart(blunt, box_of(coordinates, priors))
        why = self._search(multistart, recordings, began + self._seconds, progress)
        progress("polishing")
        last, stuck = _settled(multistart, recordings)
        solution = Solution(
            build, noises, last, begun, blunt.evaluations + last.evaluations, time.perf_counter() - began
        )
        answer = least_squares_answer(self.name, self.version, solution)
        doubted = doubts(build, sweeps, answer.constants, answer.derived, answer.rms_log_error)
        return replace(answer, says=(*_says(multistart, why), *_at_bounds(stuck), *doubted, *answer.says))

    def _search(
        self,
        multistart: Multistart,
        recordings: Sequence[Recording],
        deadline: float,
        progress: Callable[[str], None],
    ) -> str:
        """Search for minima; return the reason for ending."""
        box, (cost, slope) = multistart.box, costs(multistart.objective)
        described = False
        for k, (algorithm, per_coordinate) in enumerate(_ALGORITHMS):
            left = deadline - time.perf_counter()
            if left <= 0:
                return f"the time of {self._seconds:g} s was over"
            progress(f"searching: {algorithm}")
            share = left / (len(_ALGORITHMS) - k + 1)
            end = search(algorithm, cost, slope, box, per_coordinate * box.start.size, share, self._seed + k)
            multistart.polish(end.x, algorithm)
            described = multistart.led_by(algorithm) and multistart.describes(recordings)
            if described:
                break
        rng = np.random.default_rng(self._seed)
        while time.perf_counter() < deadline:
            progress(f"searching: {multistart.descents} descents, {len(multistart.minima)} minima")
            multistart.polish(rng.uniform(box.low, box.high), "multistart")
            if multistart.unseen < _UNSEEN or multistart.better < _BETTER:
                unseen, better = multistart.unseen, multistart.better
                return f"{unseen:.2g} more minima are expected, a deeper one with probability {better:.2g}"
            if multistart.descents == _ENOUGH and (described or multistart.describes(recordings)):
                return "the deepest describes every recording to its noise, so none can be better"
        return f"the time of {self._seconds:g} s was over"


def _settled(multistart: Multistart, recordings: Sequence[Recording]) -> tuple[Descent, tuple[str, ...]]:
    """Return the best of the deepest minima at the recordings' full weight, and the constants held at a bound."""
    if not multistart.minima:
        raise FitError("the model gives no number anywhere inside the bounds of the search")
    near = [minimum for minimum in multistart.minima[:_POLISHED] if minimum.cost < 4 * multistart.minima[0].cost + 1]
    ends = [_settled_inside(multistart, recordings, minimum.x) for minimum in near]
    best, stuck = min(ends, key=lambda end: rms(*end[0].objective.log_ratios(end[0].x)))
    return replace(best, evaluations=sum(end.evaluations for end, _ in ends)), stuck


def _settled_inside(
    multistart: Multistart, recordings: Sequence[Recording], x: Reals
) -> tuple[Descent, tuple[str, ...]]:
    """Settle from x; hold a constant at its bound if it would leave it."""
    coordinates, priors, box = multistart.objective.coordinates, multistart.objective.priors, multistart.box
    bounds = dict(zip(box.names, zip(box.low.tolist(), box.high.tolist(), strict=True), strict=True))
    stuck: list[str] = []
    while True:
        last = settle(recordings, coordinates, priors, x)
        out = [
            name
            for name, value in zip(coordinates.free, last.x.tolist(), strict=True)
            if not bounds[name][0] <= value <= bounds[name][1] and not name.endswith(_HARMLESS)
        ]
        if not out:
            return last, tuple(stuck)
        stuck += out
        held = np.array([np.clip(v, *bounds[n]) for n, v in zip(coordinates.free, last.x.tolist(), strict=True)])
        values, _ = coordinates.forward(held)
        coordinates = Coordinates(coordinates.blocks, values, tuple(n for n in coordinates.free if n not in stuck))
        x = coordinates.x


def _at_bounds(stuck: tuple[str, ...]) -> tuple[str, ...]:
    if not stuck:
        return ()
    return (
        f"{', '.join(stuck)} would leave the physical bounds and was held at them: the model does not describe this "
        "device, or build and data sheet are far off. Do not use these numbers; `mason` knows no such bounds, and "
        "names the diameter or thickness that would explain them.",
    )


def _says(multistart: Multistart, why: str) -> tuple[str, ...]:
    lines = [f"{multistart.descents} descents ended in {len(multistart.minima)} distinct minima; {why}."]
    moved = _moved(multistart)
    for k, minimum in enumerate(multistart.minima[:4]):
        values, _ = multistart.objective.coordinates.forward(minimum.x)
        key = [name for name in values if name.endswith(("c33D.re", "h33.re", ".z", ".c")) and name in moved]
        shown = ", ".join(f"{name.removesuffix('.re')} {values[name]:.4g}" for name in key[:6])
        by = ", ".join(f"{who} {minimum.found_by.count(who)}x" for who in dict.fromkeys(minimum.found_by))
        lines.append(f"Minimum {k + 1}: RMS log error {rms(minimum.curves):.2g} ({by}); {shown}.")
    return tuple(lines)


def _moved(multistart: Multistart) -> set[str]:
    """Return the names of the model parameters that the search changes, without those tied to another layer's."""
    coordinates = multistart.objective.coordinates
    _, J = coordinates.forward(coordinates.x)
    own = {name.removesuffix(".loss") for name in coordinates.names}
    changed = {name for name, row in zip(coordinates.parameters, J, strict=True) if np.any(row)}
    return {name for name in changed if name.removesuffix(".re").removesuffix(".im") in own}
