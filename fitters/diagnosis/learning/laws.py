"""The law of a correction: causal, passive laws of growing order are compared by evidence."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np
from scipy.optimize import least_squares

from ....models.base.arrays import Complexes, Reals
from ....models.base.errors import PzctlError
from ....models.effects import EffectParameter
from ....models.effects.learned.corrections import Place, places
from ....models.effects.learned.laws import Law, laws
from ....models.effects.learned.learned import LearnedLaw
from ....models.effects.learned.several import MOST, numbered, resonant, several
from ....models.stack import Stack
from ...error_model.error_columns import stack_of
from ...error_model.error_sizes import ErrorSizes
from ..hypotheses.hypothesis import Hypothesis, fitted
from ..hypotheses.problem import Candidate, Problem
from .delays import delays_at
from .drawn_corrections import PlacedCorrection, drawn_law
from .places import all_places, learned_in, number_at
from .sharp import SharpCorrection, resonance_at, sharp_corrections, worth_of_resonance
from .usual_fits import usually_fitted

_TRIALS = 6
"""Start values of a frequency over its range."""
_LEAST, _MOST = 1e-3, 0.9
"""Limits of the start value of an echo, relative to natural size and largest value."""
_FLOOR = 0.05
"""Smallest uncertainty of a drawn correction that is used, relative to its largest value."""


_ROUGHLY = 3
"""Budget: number of laws found by plain least squares that are fitted by marginal likelihood."""


@dataclass(frozen=True, eq=False)
class LearnedCorrection:
    """A law fitted at one place."""

    placed: PlacedCorrection
    effect: LearnedLaw
    candidate: Candidate
    hypothesis: Hypothesis
    probability: float
    """Probability of this law among the laws tried at this place."""

    @property
    def joint(self) -> float:
        """Probability of this place and this law."""
        return self.placed.probability * self.probability


def learned_laws(
    problem: Problem, parent: Hypothesis, placed: PlacedCorrection, progress: Callable[[str], None] = lambda _: None
) -> tuple[LearnedCorrection, ...]:
    """Return the laws fitted at a place in addition to a hypothesis, most probable first."""
    made: list[_Made] = []
    for place, law in _forms(placed.place, stack_of(problem.recordings[-1].model)):
        if _has(problem, parent, place, placed.steps, law):
            continue
        effect, one = _candidate(problem, parent, place, placed.steps, law)
        progress(f"trying the law {law.name} of {place.says}")
        sizes = placed.hypothesis.fit.sizes, parent.fit.sizes
        best = _fitted(problem, parent, one, _starts(effect, one, placed, parent), sizes)
        if best is not None:
            made.append((effect, one, best))
    return _weighed(placed, made)


def sharp_laws(
    problem: Problem, parent: Hypothesis, residual: Hypothesis, progress: Callable[[str], None] = lambda _: None
) -> tuple[LearnedCorrection, ...]:
    """Return resonances and echoes in addition to a hypothesis, at the places where they explain most of a residual."""
    found: list[LearnedCorrection] = []
    for sharp in sharp_corrections(problem, residual, all_places(problem, loads=True)):
        if _has(problem, parent, sharp.place, sharp.steps, sharp.law):
            continue
        try:
            found += _sharp(problem, parent, sharp, progress)
        except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
            continue
    return tuple(found)


def plainly_better_laws(
    problem: Problem, parent: Hypothesis, residual: Hypothesis, progress: Callable[[str], None] = lambda _: None
) -> tuple[LearnedCorrection, ...]:
    """Return the smooth laws with which plain least squares leave least at all places, in addition to a hypothesis.

    A law may change the device by so much that no correction is found to first order. `residual`: the hypothesis at
    the minimum of plain least squares, where each begins.
    """
    progress("trying smooth laws of all places by plain least squares")
    found: list[tuple[float, Place, _Made]] = []
    for place, steps in all_places(problem, loads=True):
        for law in laws(place.quantity):
            if any(knob.name in ("delay", "q") for knob in law.parameters) or _has(problem, parent, place, steps, law):
                continue
            effect, one = _candidate(problem, parent, place, steps, law)
            values = {**residual.values, **dict(zip(one.parameters, map(_middle, one.effect_parameters), strict=True))}
            try:
                made = fitted(problem, (*parent.effects, one), values, (ErrorSizes(),), rounds=0, compared=False)
            except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
                continue
            found.append((left_by(made), place, (effect, one, made)))
    best = sorted(found, key=lambda one: one[0])[:_ROUGHLY]
    made = [_from_plain(problem, parent, place, one) for left, place, one in best if left < left_by(residual)]
    return tuple(law for laws_there in made for law in laws_there)


def _middle(knob: EffectParameter) -> float:
    """Return a value of a parameter from which plain least squares can go anywhere."""
    return knob.expected[0] if knob.from_nothing else knob.null


def _from_plain(problem: Problem, parent: Hypothesis, place: Place, found: "_Made") -> tuple[LearnedCorrection, ...]:
    effect, one, plain = found
    best = _fitted(problem, parent, one, [(plain.values, {})], (parent.fit.sizes, ErrorSizes()))
    if best is None:
        return ()
    try:
        return _weighed(drawn_law(effect, one, best), [(effect, one, best)])
    except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
        return ()


def left_by(one: Hypothesis) -> float:
    """Return the rms of ln Z that a model leaves without any errors."""
    return float(np.sqrt(np.mean(np.abs(np.concatenate(one.fit.left_by_the_model)) ** 2)))


def _sharp(
    problem: Problem, parent: Hypothesis, sharp: SharpCorrection, progress: Callable[[str], None]
) -> tuple[LearnedCorrection, ...]:
    """Return the fit of an echo, or of a resonance and of as many more at its place as evidence asks for."""
    effect, one = _candidate(problem, parent, sharp.place, sharp.steps, sharp.law)
    progress(f"trying the law {sharp.law.name} of {sharp.place.says}")
    start = {one.prefix + name: value for name, value in effect.physical(sharp.start).items()}
    starts = [(parent.values, start)] if start else [(parent.values, own) for own in _from_periods(effect, one, parent)]
    best = _fitted(problem, parent, one, starts, (parent.fit.sizes,))
    if best is None:
        return ()
    made = effect, one, best
    for count in range(2, MOST + 1) if resonant(sharp.law) else ():
        more = _with_one_more(problem, parent, sharp, made, count)
        if more is None or more[2].log_evidence <= made[2].log_evidence:
            break
        made = more
    return _weighed(drawn_law(*made), [made])


_Made = tuple[LearnedLaw, Candidate, Hypothesis]
"""A law, where it acts, and its fit."""


def _with_one_more(
    problem: Problem, parent: Hypothesis, sharp: SharpCorrection, made: _Made, count: int
) -> _Made | None:
    """Return the fit with one more resonance at the same place, where the fit without it leaves most."""
    _, before, found = made
    likely = resonance_at(problem, found, sharp.place, sharp.steps, sharp.law)
    if found.fit.shortfall == 0 or not likely or likely[0].explained < worth_of_resonance(count):
        return None
    effect, one = _candidate(problem, parent, sharp.place, sharp.steps, several(sharp.law, count))
    more = effect.physical({numbered(name, count): value for name, value in likely[0].start.items()})
    known = {name: found.values[name] for name in before.parameters}
    start = known | {one.prefix + name: value for name, value in more.items()}
    values = {name: value for name, value in found.values.items() if name not in known}
    best = _fitted(problem, parent, one, [(values, start)], (found.fit.sizes, parent.fit.sizes))
    return None if best is None else (effect, one, best)


def _has(problem: Problem, parent: Hypothesis, place: Place, steps: tuple[str, ...], law: Law) -> bool:
    """Return whether these steps have this law already: a second one of the same form is no different law."""
    known = learned_in(problem, parent)
    return any(one.place == place and one.law.name == law.name and not set(steps).isdisjoint(at) for one, at in known)


def _candidate(
    problem: Problem, parent: Hypothesis, place: Place, steps: tuple[str, ...], law: Law
) -> tuple[LearnedLaw, Candidate]:
    """Return a law as a further effect of these steps, with its frequencies in their recorded band."""
    stack = stack_of(problem.recordings[-1].model)
    ends = [recording.sweep.frequency[[0, -1]] for recording in problem.recordings if recording.step in steps]
    band = min(float(end[0]) for end in ends), max(float(end[1]) for end in ends)
    effect = LearnedLaw(place, law, stack, band=band, number=number_at(problem, parent, place.where))
    return effect, Candidate(effect, place.where, steps, effect.effect_parameters(stack, place.where))


def _weighed(placed: PlacedCorrection, made: Sequence[_Made]) -> tuple[LearnedCorrection, ...]:
    """Return fitted laws of one place with their probabilities, most probable first."""
    if not made:
        return ()
    evidence = np.array([hypothesis.log_evidence for *_, hypothesis in made])
    temper = max((one for *_, one in made), key=lambda one: one.log_evidence).coarseness
    part = np.exp((evidence - np.max(evidence)) / temper)
    shares = (part / np.sum(part)).tolist()
    found = [LearnedCorrection(placed, *one, share) for one, share in zip(made, shares, strict=True)]
    return tuple(sorted(found, key=lambda one: -one.probability))


def _forms(place: Place, stack: Stack) -> list[tuple[Place, Law]]:
    """Return the laws of a place; a load can also be corrected by a factor, as by an echo inside of it."""
    found = [(place, law) for law in laws(place.quantity)]
    factor = Place(place.where, "load")
    if place.quantity == "impedance" and factor in places(stack):
        found += [(factor, law) for law in laws(factor.quantity)]
    return found


_Start = tuple[Mapping[str, float], dict[str, float]]
"""Values of the constants, and parameters of the law, from which a fit starts."""


def _fitted(
    problem: Problem, parent: Hypothesis, one: Candidate, starts: Sequence[_Start], sizes: Sequence[ErrorSizes]
) -> Hypothesis | None:
    """Return the best fit of a law.

    Each is fitted again from its own end, because its evidence counts only where the errors are linearised.
    """
    made: list[Hypothesis] = []
    effects = (*parent.effects, one)
    for values, start in starts:
        for own in dict.fromkeys(sizes):
            try:
                once = usually_fitted(problem, effects, {**values, **start}, (own,), rounds=4)
                made.append(usually_fitted(problem, effects, once.values, (once.fit.sizes,), rounds=1))
            except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
                continue
    return max(made, key=lambda hypothesis: hypothesis.log_evidence, default=None)


def _starts(effect: LearnedLaw, one: Candidate, placed: PlacedCorrection, parent: Hypothesis) -> list[_Start]:
    """Return the starts of a law's fit: from the smooth correction, or from the residual's periods for an echo."""
    if any(knob.name == "delay" for knob in one.effect_parameters):
        return [(parent.values, start) for start in _from_periods(effect, one, parent)]
    smooth = placed.hypothesis.effects[-1].prefix
    values = {name: value for name, value in placed.hypothesis.values.items() if not name.startswith(smooth)}
    return [(values, start) for start in _start(effect, one, placed)]


def _from_periods(effect: LearnedLaw, one: Candidate, parent: Hypothesis) -> list[dict[str, float]]:
    """Return an echo at each of the likeliest delays, with half of the size that explains most to first order."""
    knobs = {knob.name: knob for knob in one.effect_parameters}
    delay = knobs["delay"]
    made: list[dict[str, float]] = []
    for found in delays_at(parent, effect.place, one.steps, delay.lower, delay.upper):
        echo = {"echo": knobs["echo"].null} if "echo" in knobs else {}
        size = effect.natural * found.amplitude / (4 * echo.get("echo", 1.0))
        size = min(max(size, _LEAST * effect.natural), _MOST * knobs["size"].upper)
        made.append({one.prefix + name: value for name, value in ({"size": size, "delay": found.delay} | echo).items()})
    return made


def _start(effect: LearnedLaw, one: Candidate, placed: PlacedCorrection) -> list[dict[str, float]]:
    """Return the parameters with which the law is closest to the smooth correction, from the best of many starts."""
    knobs = one.effect_parameters
    largest = float(np.max(np.abs(placed.correction)))
    u = np.hypot(np.hypot(placed.u_re, placed.u_im), _FLOOR * largest)
    grids = [_grid(knob, placed, largest * effect.natural) for knob in knobs]

    def parameters(z: Reals) -> dict[str, float]:
        return {knob.name: _value(knob, float(at)) for knob, at in zip(knobs, z, strict=True)}

    def residual(z: Reals) -> Reals:
        off: Complexes = (effect.correction(parameters(z))(placed.frequency) - placed.correction) / u
        return np.nan_to_num(np.concatenate([off.real, off.imag]), nan=1e6, posinf=1e6, neginf=-1e6)

    tried: list[tuple[float, Reals]] = []
    for start in product(*grids):
        z = np.array([_coordinate(knob, value) for knob, value in zip(knobs, start, strict=True)])
        tried.append((float(np.sum(residual(z) ** 2)), z))
    tried.sort(key=lambda pair: pair[0])
    ends = [least_squares(residual, z, max_nfev=60) for _, z in tried[:3]]
    ends.sort(key=lambda end: float(end.cost))
    return [{one.prefix + name: value for name, value in parameters(end.x).items()} for end in ends[:1]]


def _grid(knob: EffectParameter, placed: PlacedCorrection, size: float) -> Sequence[float]:
    if knob.name == "size":
        return (0.3 * size, size, 3 * size)
    if knob.unit == "Hz":
        return tuple(np.geomspace(knob.lower * 1.01, knob.upper * 0.99, _TRIALS).tolist())
    return (knob.null,)


def _coordinate(knob: EffectParameter, value: float) -> float:
    """Return a parameter without limits: a logarithm, or a logit between its limits."""
    if not np.isfinite(knob.upper) or knob.lower <= 0:
        return float(np.log(max(value, 1e-12 * knob.typical)))
    share = np.clip((value - knob.lower) / (knob.upper - knob.lower), 1e-6, 1 - 1e-6)
    return float(np.log(share / (1 - share)))


def _value(knob: EffectParameter, at: float) -> float:
    if not np.isfinite(knob.upper) or knob.lower <= 0:
        return float(np.exp(np.clip(at, -600, 600)))
    return float(knob.lower + (knob.upper - knob.lower) / (1 + np.exp(-np.clip(at, -60, 60))))
