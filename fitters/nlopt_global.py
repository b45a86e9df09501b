"""Fitter `nlopt-global`: the deepest minimum inside physical bounds, without trust in any start.

Four global algorithms of NLopt search a blunted objective from the middle of the bounds; descents from points drawn
evenly over the bounds search beside them; every end is polished by least squares. The search stops when a better
minimum is improbable: C. G. E. Boender, A. H. G. Rinnooy Kan, Math. Programming 37 (1987) 59: after n descents that
ended in w distinct minima, w (w + 1)/(n - w - 2) more are expected.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from scipy.optimize import least_squares

from ..models.arrays import Complexes, Reals
from ..models.errors import PzctlError
from ..models.sweep import Sweep
from .answer import least_squares_answer
from .assembly import coordinates_of, nominal_parameters, priors_of, recordings_of
from .coordinates import Coordinates
from .descent import Descent, chi2_per_point, descend, settle
from .interface import FitError, FitResult, FitTask, Noise
from .joint import Solution, check_task
from .nlopt_wrapper import Algorithm, Box, search
from .noise import noise_of
from .objective import Objective
from .recognise import refuse_degenerate
from .recording import Prior, Recording

_ALGORITHMS: tuple[tuple[Algorithm, int], ...] = (
    ("MLSL+LBFGS", 60),
    ("CRS2_LM", 150),
    ("ESCH", 100),
    ("DIRECT_L", 100),
)
# Evaluations per coordinate. A search need not converge: least squares goes on from wherever it ends.
_COARSE_POINTS, _BLUNT = 160, 0.05
# Points of a recording that the search looks at, and the noise it takes them to have: at the true noise the objective
# is a needle in a hay field.
_SAME = 1e-3
# Minima whose curves differ by less, rms of ln Z, are one.
_UNSEEN, _BETTER = 0.5, 0.02
_ENOUGH = 12
# Descents after which a minimum that describes every recording to its noise is taken: none can be better.
_DESCRIBED = 1.3
_POLISHED = 3
_EVALUATIONS = 100
_ROUGH = 1e-6
_HARMLESS = (".loss", ".q", "back.z", "front.z")
# Coordinates that remain physical whatever their value is.
_NARROWEST, _WIDEST = np.log(1.5), np.log(10.0)
_LOSSES = np.log(1e-4), np.log(0.3)


@dataclass
class _Minimum:
    """A distinct minimum of the blunted objective."""

    x: Reals
    cost: float
    curves: Complexes
    """ln(Z_model/Z_measured) of all coarse points."""
    found_by: list[str] = field(default_factory=list[str])

    @property
    def rms(self) -> float:
        """Root mean square of |ln(Z_model/Z_measured)|."""
        return float(np.sqrt(np.mean(np.abs(self.curves) ** 2)))


@dataclass
class _Hunt:
    """The minima seen so far."""

    objective: Objective
    box: Box
    minima: list[_Minimum] = field(default_factory=list[_Minimum])
    descents: int = 0

    def polish(self, x: Reals, by: str) -> None:
        """Descend from x and enter the minimum."""
        end = _inside(self.objective, self.box, x)
        self.descents += 1
        try:
            curves = np.concatenate(self.objective.log_ratios(end))
        except (PzctlError, ArithmeticError):
            return
        if not np.all(np.isfinite(curves)):
            return
        for minimum in self.minima:
            if np.sqrt(np.mean(np.abs(minimum.curves - curves) ** 2)) < _SAME:
                minimum.found_by.append(by)
                return
        cost = float(np.sum(self.objective.residual(end) ** 2)) / 2
        self.minima.append(_Minimum(end, cost, curves, [by]))
        self.minima.sort(key=lambda minimum: minimum.cost)

    @property
    def unseen(self) -> float:
        """Expected number of minima not seen yet."""
        n, w = self.descents, len(self.minima)
        return w * (w + 1) / (n - w - 2) if n > w + 2 else np.inf

    @property
    def better(self) -> float:
        """Chance that one of them is deeper than all that were seen, where any order of depths is as probable."""
        return min(1.0, self.unseen / (len(self.minima) + 1))


class NloptGlobal:
    """Global search over physical bounds with NLopt, polished by least squares."""

    name = "nlopt-global"
    version = "1"
    summary = "NLopt's CRS2, ESCH, MLSL, DIRECT and multistart over physical bounds, polished; reports distinct minima"

    def __init__(self, seconds: float = 60.0, seed: int = 1) -> None:
        """`seconds`: after which the search ends with what it has; `seed` of all that is drawn."""
        self._seconds, self._seed = seconds, seed

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the constants of all layers to all steps at once.

        What `progress` raises ends the search. Raises FitError where the recordings do not belong to the build.
        """
        began = time.perf_counter()
        build, sweeps = check_task(task)
        refuse_degenerate(build, sweeps)
        found = {step: noise_of(of_step) for step, of_step in sweeps.items()}
        noises: Mapping[str, Noise] = {step: noise for step, (noise, _) in found.items()}
        recordings = [
            recording
            for step, of_step in sweeps.items()
            for recording in recordings_of(build, step, of_step, found[step][1])
        ]
        begun = nominal_parameters(build)
        coordinates, priors = coordinates_of(build, sweeps, begun, task.free), priors_of(build, sweeps)
        if coordinates.x.size == 0:
            raise FitError("nothing is free to be fitted: every constant of the build is taken as exact")
        coarse = Objective(_coarse(recordings), coordinates, priors)
        hunt = _Hunt(coarse, box_of(coordinates, priors))
        why = self._search(hunt, recordings, began + self._seconds, progress)
        progress("polishing")
        last, stuck = _settled(hunt, recordings)
        solution = Solution(
            build, noises, last, begun, coarse.evaluations + last.evaluations, time.perf_counter() - began
        )
        answer = least_squares_answer(self.name, self.version, solution)
        return replace(answer, says=(*_says(hunt, why), *_at_bounds(stuck), *answer.says))

    def _search(
        self,
        hunt: _Hunt,
        recordings: Sequence[Recording],
        deadline: float,
        progress: Callable[[str], None],
    ) -> str:
        """Fill the hunt with minima; return why it ended."""
        box, (cost, slope) = hunt.box, _costs(hunt.objective)
        for k, (algorithm, per_coordinate) in enumerate(_ALGORITHMS):
            left = deadline - time.perf_counter()
            if left <= 0:
                return f"the time of {self._seconds:g} s was over"
            progress(f"searching: {algorithm}")
            share = left / (len(_ALGORITHMS) - k + 1)
            end = search(algorithm, cost, slope, box, per_coordinate * box.start.size, share, self._seed + k)
            hunt.polish(end.x, algorithm)
        rng = np.random.default_rng(self._seed)
        while time.perf_counter() < deadline:
            progress(f"searching: {hunt.descents} descents, {len(hunt.minima)} minima")
            hunt.polish(rng.uniform(box.low, box.high), "multistart")
            if hunt.unseen < _UNSEEN or hunt.better < _BETTER:
                return f"{hunt.unseen:.2g} unseen minima are expected, a deeper one with probability {hunt.better:.2g}"
            if hunt.descents == _ENOUGH and _describes(hunt, recordings):
                return "the deepest describes every recording to its noise, so none can be better"
        return f"the time of {self._seconds:g} s was over"


def _coarse(recordings: Sequence[Recording]) -> list[Recording]:
    """Return the recordings as the search looks at them: one for each step, of fewer points, and blunt."""
    found: list[Recording] = []
    for step in dict.fromkeys(recording.step for recording in recordings):
        of_step = [recording for recording in recordings if recording.step == step]
        kept = [slice(None, None, max(1, r.sweep.frequency.size // _COARSE_POINTS)) for r in of_step]
        pairs = list(zip(of_step, kept, strict=True))
        frequency, first = np.unique(
            np.concatenate([r.sweep.frequency[every] for r, every in pairs]), return_index=True
        )
        few = Sweep(frequency, np.concatenate([r.sweep.impedance[every] for r, every in pairs])[first])
        found.append(replace(of_step[0], sweep=few, noise=np.zeros(frequency.size), misfit=_BLUNT))
    return found


def _costs(objective: Objective) -> tuple[Callable[[Reals], float], Callable[[Reals], tuple[float, Reals]]]:
    """Return half the sum of squares alone, and with its gradient."""

    def slope(x: Reals) -> tuple[float, Reals]:
        r = objective.residual(x)
        return float(r @ r) / 2, np.asarray(objective.jacobian(x).T @ r)

    return objective.cost, slope


def box_of(coordinates: Coordinates, priors: Sequence[Prior]) -> Box:
    """Return the bounds: four standard uncertainties, and never less than a factor of 1.5 to either side.

    Losses range from 1e-4 to 0.3, the quality of a passive layer over a factor of ten to either side, a load from
    nothing to three times its value.
    """
    x, values = coordinates.x, coordinates.forward(coordinates.x)[0]
    spread = {prior.parameter.removesuffix(".re"): 4 * prior.u / abs(prior.mean) for prior in priors if prior.mean}
    low, high = np.zeros(x.size), np.zeros(x.size)
    for k, name in enumerate(coordinates.free):
        if name.endswith("h33.loss"):
            low[k], high[k] = -1.4, 1.4
        elif name.endswith(".loss"):
            low[k], high[k] = min(_LOSSES[0], x[k]), max(_LOSSES[1], x[k])
        elif name in ("back.z", "front.z"):
            low[k], high[k] = min(0.0, x[k]), max(3.0, x[k])
        else:
            reach = _WIDEST if name.endswith(".q") else np.clip(spread.get(name, 0.0), _NARROWEST, _WIDEST)
            of = name if name in values else f"{name}.re"
            ends = [coordinates.inverse({**values, of: values[of] * np.exp(s * reach)})[k] for s in (-1, 1)]
            low[k], high[k] = min(ends), max(ends)
    return Box(coordinates.free, low, high, x)


def _describes(hunt: _Hunt, recordings: Sequence[Recording]) -> bool:
    """Say whether the deepest minimum, settled at the recordings' own noise, describes all of them to it."""
    objective = hunt.objective
    last = descend(Objective(recordings, objective.coordinates, objective.priors), hunt.minima[0].x, _ROUGH)
    ratios = last.objective.log_ratios(last.x)
    return all(chi2_per_point(r, ratio) < _DESCRIBED for r, ratio in zip(recordings, ratios, strict=True))


def _inside(objective: Objective, box: Box, x: Reals) -> Reals:
    """Return where least squares from x ends without leaving the box.

    Levenberg-Marquardt is several times faster; where it goes out of the box, a trust region inside it goes again.
    """
    free = descend(objective, x, _ROUGH).x
    if np.all((box.low <= free) & (free <= box.high)):
        return free
    margin = 1e-6 * (box.high - box.low)
    found = least_squares(
        objective.residual,
        np.clip(x, box.low + margin, box.high - margin),
        jac=objective.jacobian,
        bounds=(box.low, box.high),
        x_scale="jac",
        ftol=_ROUGH,
        xtol=_ROUGH,
        gtol=_ROUGH,
        max_nfev=_EVALUATIONS,
    )
    return np.asarray(found.x, np.float64)


def _settled(hunt: _Hunt, recordings: Sequence[Recording]) -> tuple[Descent, tuple[str, ...]]:
    """Return the best of the deepest minima at the recordings' full weight, and the constants held at a bound."""
    if not hunt.minima:
        raise FitError("the model gives no number anywhere inside the bounds of the search")
    near = [minimum for minimum in hunt.minima[:_POLISHED] if minimum.cost < 4 * hunt.minima[0].cost + 1]
    ends = [_settled_inside(hunt, recordings, minimum.x) for minimum in near]

    def rms(end: tuple[Descent, tuple[str, ...]]) -> float:
        descent = end[0]
        return float(np.mean(np.abs(np.concatenate(descent.objective.log_ratios(descent.x))) ** 2))

    best, stuck = min(ends, key=rms)
    return replace(best, evaluations=sum(end.evaluations for end, _ in ends)), stuck


def _settled_inside(hunt: _Hunt, recordings: Sequence[Recording], x: Reals) -> tuple[Descent, tuple[str, ...]]:
    """Settle from x; a constant that would leave its bounds is held at them."""
    coordinates, priors, box = hunt.objective.coordinates, hunt.objective.priors, hunt.box
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
        "device, or build and data sheet are far off. Do not use these numbers.",
    )


def _says(hunt: _Hunt, why: str) -> tuple[str, ...]:
    lines = [f"{hunt.descents} descents ended in {len(hunt.minima)} distinct minima; {why}."]
    for k, minimum in enumerate(hunt.minima[:4]):
        values, _ = hunt.objective.coordinates.forward(minimum.x)
        key = [name for name in values if name.endswith(("c33D.re", "h33.re", ".z", ".c")) and name in _moved(hunt)]
        shown = ", ".join(f"{name.removesuffix('.re')} {values[name]:.4g}" for name in key[:6])
        by = ", ".join(f"{who} {minimum.found_by.count(who)}x" for who in dict.fromkeys(minimum.found_by))
        lines.append(f"Minimum {k + 1}: RMS log error {minimum.rms:.2g} ({by}); {shown}.")
    return tuple(lines)


def _moved(hunt: _Hunt) -> set[str]:
    """Return the names of the model parameters that the search moves."""
    coordinates = hunt.objective.coordinates
    _, J = coordinates.forward(coordinates.x)
    return {name for name, row in zip(coordinates.parameters, J, strict=True) if np.any(row)}
