"""Screening of candidates: compute the gain of each effect at a few plausible sizes without fitting it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.base.model import Model
from ....models.effects import Device, EffectParameter
from ...engine.on_cores import on_cores
from ...error_model.error_columns import ErrorColumns, WeakLine
from ...error_model.error_sizes import USUAL, ErrorSizes
from ...error_model.marginal_fit import ONE_IN_TWENTY
from ...error_model.point_covariance import Kernel, PointErrors
from ..decision_rules import ABSORBED, NAMED
from ..hypotheses.changes import change_by
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.own_losses import drawn_by_losses
from ..hypotheses.problem import Candidate, Problem
from .echo_delays import likely_delays, longest_delay
from .weak_lines import strongest_lines

_SPREADS = (-3.5, -2.0, -1.0, 0.0, 1.0)
"""Trial sizes, in standard deviations of ln size."""
_SIGNED = (-0.5, -0.1, -0.02, 0.02, 0.1, 0.5)
_STRETCH = 2.5
"""Largest factor by which a change is scaled linearly; it may become as small as needed."""
_HIGHEST = 3.0
"""Standard deviations of ln size above the median up to which the change by a resonance is scaled: it is a branch in
parallel with the device, so that its change is linear in its strength."""
_LINES = 100
"""Number of trial frequencies of a further resonance."""
_SCANS = 160
_STRONGEST = 3
"""Number of lines of the residual at which a sharp resonance is tried."""
_BROUGHT = 5
"""Times that sizes are brought nearer to where a change is as large as another: each leaves a third of the difference,
or less."""
_SAME = 0.999999
_SMALL = 1e-2
"""Amplitude of an echo, relative to the usual one, from which its change of ln Z is taken to first order."""


@dataclass(frozen=True)
class ScreenedCandidate:
    """Expected benefit of an effect."""

    candidate: Candidate
    gain: float
    """Expected increase of the ln likelihood."""
    start: dict[str, float]
    survives: float = 1.0
    """Part of its change, 0 to 1, that constants and errors cannot imitate."""
    twins: tuple[Candidate, ...] = ()
    """The same effect at places where symmetry makes it do exactly the same."""

    @property
    def absorbed(self) -> bool:
        """Whether constants absorb its change, so that its gain says little."""
        return self.survives < ABSORBED

    @property
    def starts(self) -> list[dict[str, float]]:
        """The start and, for an effect that constants absorb or that is unusually small there, one with a large size.

        It may lie far from there: what an effect promises is only linear in its size.
        """
        knobs = {name: knob for name, knob in self.candidate.sizes if knob.from_nothing}
        large = {name: _large(knob) for name, knob in knobs.items()}
        small = all(self.start[name] < _small(knob) for name, knob in knobs.items())
        return [self.start, {**self.start, **large}] if large and (self.absorbed or small) else [self.start]


def _small(knob: EffectParameter) -> float:
    """Return a size below which one in twenty is."""
    median, spread = knob.expected
    return float(median * np.exp(-ONE_IN_TWENTY * spread))


def _large(knob: EffectParameter) -> float:
    """Return a size one standard deviation above its median."""
    median, spread = knob.expected
    return float(min(median * np.exp(spread), knob.upper))


def screened(
    problem: Problem, parent: Hypothesis, candidates: Sequence[Candidate], jobs: int = 1
) -> tuple[list[ScreenedCandidate], ...]:
    """Return four lists of candidates beside a hypothesis, largest gain first.

    The lists differ in how they treat the residual: as noise, as errors of a good device and instrument, as the
    hypothesis's own errors, or as these without the rough ones, which describe anything. `jobs`: number of processes.
    """
    lines = _lines(parent, candidates)
    made = [partial(_changes_beside, problem, parent, one, lines.get(one.step, [])) for one in candidates]
    changed = on_cores(made, jobs)
    trials = [(one, *change) for one, own in zip(candidates, changed, strict=True) for change in own]
    if not trials:
        return [], [], [], []
    changes = [np.stack([change[k] for _, _, change in trials], axis=1) for k in range(len(problem.recordings))]
    twins = _twins(trials, changes)
    starts = [(one, values) for one, values, _ in trials]
    furthest = np.array([_furthest(one, values) for one, values in starts])
    usual_errors = replace(USUAL, colour=parent.fit.sizes.colour)
    own = parent.fit.sizes
    treatments = (None, usual_errors, own, own.smooth)
    gains = {sizes: _gains(parent, changes, furthest, sizes) for sizes in treatments}  # some may be the same
    return tuple(_ranked(starts, gains[sizes], twins) for sizes in treatments)


def explaining_most(
    problem: Problem, parent: Hypothesis, candidates: Sequence[Candidate], jobs: int = 1
) -> tuple[Candidate, ...]:
    """Return the candidates that promise to explain most of what a hypothesis leaves, beside small shifts of constants.

    Only these can be named if much more than noise is left: what an effect changes must be more than what no effect
    explains to be told from it.
    """
    as_noise, *_ = screened(problem, parent, candidates, jobs)
    return tuple(one.candidate for one in as_noise if one.gain > NAMED * problem.points)


def resembling(
    problem: Problem, one: Hypothesis, effect: Candidate, rest: Hypothesis, candidates: Sequence[Candidate]
) -> list[ScreenedCandidate]:
    """Return the candidates that change ln Z in place of an effect of a hypothesis as that does, most similar first.

    Beside its other effects and at its constants: those of `rest`, which lacks the effect, may have gone far to imitate
    it; only where lines stand out is read from its residual. Constants are projected out; the gain of each is its
    correlation, 0 to 1. A large change has the shape of another only where it is as large, so that sizes are brought
    there.
    """
    own, lines = change_by(problem, one, effect), _lines(rest, candidates)
    others = [other for other in one.effects if other is not effect]
    changers = {other: _changer(problem, others, one.values, other) for other in candidates}
    changes = [
        (other, _changes(problem, rest, other, lines.get(other.step, []), changers[other])) for other in candidates
    ]
    trials = [(other, values, change) for other, tried in changes for values, change in tried]
    if not trials:
        return []
    best: dict[Candidate, ScreenedCandidate] = {}
    nearest: dict[Candidate, tuple[dict[str, float], float]] = {}
    for (other, values, _), like in zip(trials, _likeness(one, own, trials), strict=True):
        if other not in best or like.correlation > best[other].gain:
            stretch = float(np.clip(like.along, 1 / _STRETCH, _STRETCH))
            best[other] = ScreenedCandidate(other, like.correlation, _stretched(other, values, stretch))
            nearest[other] = values, like.length
    for _ in range(_BROUGHT):
        moved = [(other, _stretched(other, *near)) for other, near in nearest.items() if _grows(other)]
        made = [(other, values, changers[other](values)) for other, values in moved]
        trials = [trial for trial in made if _is_finite(trial[2])]
        nearest = {}
        for (other, values, _), like in zip(trials, _likeness(one, own, trials), strict=True):
            nearest[other] = values, like.length
            if like.correlation > best[other].gain:
                best[other] = ScreenedCandidate(other, like.correlation, values)
    return sorted(best.values(), key=lambda promise: -promise.gain)


class _Likeness(NamedTuple):
    """How a change of ln Z is like another one."""

    correlation: float
    """Without its sign, 0 to 1."""
    along: float
    """Factor by which it is nearest to the other one."""
    length: float
    """Factor by which it is as large as the other one."""


def _likeness(
    one: Hypothesis, own: Sequence[Complexes], trials: Sequence[tuple[Candidate, dict[str, float], list[Complexes]]]
) -> list[_Likeness]:
    """Return how each change is like `own` beyond what the constants of a hypothesis could do."""
    columns = one.projected([list(own), *(change for *_, change in trials)])
    norm = np.maximum(np.linalg.norm(columns, axis=0), 1e-300)
    along = columns[:, 0] @ columns / norm**2
    return [
        _Likeness(abs(factor) * size / float(norm[0]), factor, float(norm[0]) / size)
        for factor, size in zip(along[1:].tolist(), norm[1:].tolist(), strict=True)
    ]


def _is_finite(changed: Sequence[Complexes]) -> bool:
    return all(np.all(np.isfinite(own)) for own in changed)


def _grows(one: Candidate) -> bool:
    """Return whether a change grows with all sizes of an effect, from none."""
    return all(knob.from_nothing for _, knob in one.sizes)


def _lines(parent: Hypothesis, candidates: Sequence[Candidate]) -> dict[str, list[WeakLine]]:
    """Return the strongest lines of the residual in each step in which a sharp resonance may first appear."""
    steps = dict.fromkeys(one.step for one in candidates if one.resonates)
    return {step: strongest_lines(parent, step, _STRONGEST) for step in steps}


def _changes_beside(
    problem: Problem, parent: Hypothesis, one: Candidate, lines: Sequence[WeakLine]
) -> list[tuple[dict[str, float], list[Complexes]]]:
    """Return the trial parameters of an effect beside a hypothesis, and the change of ln Z in every recording."""
    return _changes(problem, parent, one, lines, _changer(problem, parent.effects, parent.values, one))


def _changes(
    problem: Problem,
    parent: Hypothesis,
    one: Candidate,
    lines: Sequence[WeakLine],
    change: Callable[[Mapping[str, float]], list[Complexes]],
) -> list[tuple[dict[str, float], list[Complexes]]]:
    """Return the same for another `change`; lines and delays are those that the residual of `parent` shows."""
    delays = _delays(parent, one, change)
    made: list[tuple[dict[str, float], list[Complexes]]] = []
    for effect_parameters in _trials(problem, one, lines, delays):
        values = {one.prefix + name: value for name, value in effect_parameters.items()}
        changed = change(values)
        if _is_finite(changed):
            made.append((values, changed))
    return made


def _changer(
    problem: Problem, effects: Sequence[Candidate], at: Mapping[str, float], one: Candidate
) -> Callable[[Mapping[str, float]], list[Complexes]]:
    """Return the function from an effect's parameters to its change of ln Z in every recording.

    `effects`: beside these; `at`: for these values of all other parameters.
    """
    with_one = problem.with_effects([*effects, one])
    models: list[Model] = []
    for recording in with_one:
        model = recording.model
        renamed = {recording.renamed.get(name, name): name for name in model.parameters()}
        models.append(model.replace({own: at[name] for name, own in renamed.items() if name in at}))
    sweeps = [recording.sweep.frequency for recording in with_one]
    devices = {
        k: model
        for k, (recording, model) in enumerate(zip(with_one, models, strict=True))
        if recording.step in one.steps and isinstance(model, Device)
    }

    def change(values: Mapping[str, float]) -> list[Complexes]:
        return [
            devices[k].log_ratio(devices[k].replace(values), f) if k in devices else np.zeros(f.size, np.complex128)
            for k, f in enumerate(sweeps)
        ]

    return change


def _delays(
    parent: Hypothesis, one: Candidate, change: Callable[[Mapping[str, float]], list[Complexes]]
) -> tuple[float, ...]:
    """Return the delays of an echo that the residual shows, if the effect is one."""
    knob = next((knob for knob in one.effect_parameters if knob.delay), None)
    if knob is None:
        return ()
    amplitude = one.effect_parameters[0]
    size = _SMALL * amplitude.expected[0]
    values = {name: own.null for name, own in zip(one.parameters, one.effect_parameters, strict=True)}
    changed = change({**values, one.prefix + amplitude.name: size})
    parts: list[tuple[Reals, Complexes, Complexes, Complexes]] = []
    made = parent.fit.gram
    for recording, own, J, r in zip(parent.objective.recordings, changed, made.J, made.r, strict=True):
        f = recording.sweep.frequency
        slope = own / size * np.exp(2j * np.pi * f * knob.null)
        on = np.isfinite(recording.noise) & np.isfinite(slope) & (recording.step in one.steps)
        parts.append((f[on], slope[on], J[on], r[on]))
    found = likely_delays(
        np.concatenate([one[0] for one in parts]),
        np.concatenate([one[1] for one in parts]),
        np.concatenate([one[2] for one in parts]),
        np.concatenate([one[3] for one in parts]),
        knob.lower,
        min(knob.upper, longest_delay([one[0] for one in parts])),
    )
    return tuple(one.delay for one in found)


def _trials(
    problem: Problem, one: Candidate, lines: Sequence[WeakLine], delays: tuple[float, ...]
) -> list[dict[str, float]]:
    sizes, others = one.effect_parameters[: one.effect.sizes], one.effect_parameters[one.effect.sizes :]
    if one.resonates:
        rest = _at_lines(lines, one, {knob.name: knob.null for knob in others})
    else:
        grids = [delays if knob.delay and delays else _scan(problem, knob) for knob in others]
        rest = [dict(zip((k.name for k in others), values, strict=True)) for values in product(*grids)]
    far = len(rest) > 1 or one.resonates
    made: list[dict[str, float]] = []
    for knob in sizes:
        small = [own for own in sizes if own is not knob]
        besides = [
            dict(zip((own.name for own in small), values, strict=True)) for values in product(*map(_while_small, small))
        ]
        centre, spread = knob.expected
        steps = (_SPREADS if not far else (-1.0,)) if knob.from_nothing else _SIGNED
        for z in steps:
            value = centre * np.exp(spread * z) if knob.from_nothing else centre + spread * z
            value = float(np.clip(value, knob.lower, 0.5 * knob.upper if np.isfinite(knob.upper) else knob.upper))
            made += [{**beside, **other, knob.name: value} for beside in besides for other in rest]
    return made[:: max(1, len(made) // _SCANS)]


def _while_small(knob: EffectParameter) -> tuple[float, ...]:
    """Return the values that a size has while another size of the effect is tried."""
    return knob.scan or (1e-4 * knob.expected[0] if knob.from_nothing else knob.null,)


def _at_lines(lines: Sequence[WeakLine], one: Candidate, others: dict[str, float]) -> list[dict[str, float]]:
    """Return the values of a sharp resonance's parameters that are no sizes, for each of these lines."""
    frequency = one.resonance_parameters[0].removeprefix(one.prefix)
    return [{**others, frequency: line.frequency, "q": line.q} for line in lines]


def _furthest(one: Candidate, values: dict[str, float]) -> float:
    """Return the largest factor by which the change of a trial is scaled linearly."""
    if not one.resonates:
        return _STRETCH
    name, knob = max(one.sizes, key=lambda size: values[size[0]] / size[1].expected[0])
    median, spread = knob.expected
    return max(_STRETCH, median * float(np.exp(_HIGHEST * spread)) / values[name])


def _scan(problem: Problem, knob: EffectParameter) -> tuple[float, ...]:
    if knob.scan:
        return knob.scan
    if knob.unit == "Hz":
        low = min(float(recording.sweep.frequency[0]) for recording in problem.recordings)
        high = max(float(recording.sweep.frequency[-1]) for recording in problem.recordings)
        return tuple(np.geomspace(low, high, _LINES + 2)[1:-1].tolist())
    return (knob.expected[0] if knob.from_nothing else knob.null,)


def _gains(
    parent: Hypothesis, changes: Sequence[Complexes], furthest: Reals, sizes: ErrorSizes | None
) -> tuple[Reals, Reals, Reals]:
    """Return the increase of ln likelihood along each change, its best scale factor and the part of it that survives.

    Each of shape (T,), as `furthest`, the largest scale factors. What survives is not imitated by constants and errors.
    `sizes` are those of the errors; None treats the residual as noise.
    """
    made = parent.fit.gram
    columns = made.columns
    if sizes is None:
        misfits = [float(np.sqrt(np.mean(np.abs(r) ** 2) / 2)) for r in made.r]
        points = tuple(
            PointErrors(own.log_f, np.hypot(own.noise, misfit), own.felt, own.bent)
            for own, misfit in zip(columns.points, misfits, strict=True)
        )
        columns, sizes = ErrorColumns((), np.zeros(0), tuple(b[:, :0] for b in columns.blocks), points), ErrorSizes()
    on, d = columns.present(sizes.of_columns())
    J = made.J
    blocks = [
        np.concatenate([c[:, on] * d, j, r[:, None]], axis=1) for c, j, r in zip(columns.blocks, J, made.r, strict=True)
    ]
    kernel = Kernel(columns.points, sizes.colour, sizes.rough)
    there, tried = kernel.white(blocks), kernel.white(changes)
    G, beside, lengths = there.squared(), there.times(tried), tried.lengths()
    C, M = on.size, J[0].shape[1]
    own = G[:-1, :-1].copy()
    own[:C, :C] += np.eye(C)
    # the constants may have taken over what an effect does, at the price of losses that no such material has
    information, pull = drawn_by_losses(parent.losses, parent.fit)
    own[C:, C:] += made.before.P + information
    right = np.concatenate([beside[:-1], G[:-1, -1:]], axis=1)
    right[C:, -1] += made.before.g + pull
    unit = np.sqrt(np.maximum(np.diag(own), 1e-300))
    solved = np.linalg.solve(own / unit / unit[:, None] + 1e-11 * np.eye(C + M), right / unit[:, None])
    right = right / unit[:, None]
    c = lengths - np.sum(right[:, :-1] * solved[:, :-1], axis=0)
    b = -(beside[-1] - right[:, :-1].T @ solved[:, -1])
    c = np.maximum(c, 1e-30)
    a = np.clip(b / c, 0.0, furthest)
    return a * b - a**2 * c / 2, a, np.sqrt(c / np.maximum(lengths, 1e-300))


_Start = tuple[Candidate, dict[str, float]]


def _ranked(
    starts: Sequence[_Start], gains: tuple[Reals, Reals, Reals], twins: dict[Candidate, Candidate]
) -> list[ScreenedCandidate]:
    best: dict[Candidate, tuple[float, dict[str, float], float]] = {}
    for (one, values), gain, stretch, survives in zip(starts, *(part.tolist() for part in gains), strict=True):
        if one not in twins and (one not in best or gain > best[one][0]):
            best[one] = gain, _stretched(one, values, stretch), survives
    same = {one: tuple(t for t, of in twins.items() if of == one) for one in best}
    found = [ScreenedCandidate(one, *promise, same[one]) for one, promise in best.items()]
    return sorted(found, key=lambda promise: -promise.gain)


def _stretched(one: Candidate, values: dict[str, float], stretch: float) -> dict[str, float]:
    """Return the trial values with sizes scaled to the best fit."""
    sizes = {name: knob for name, knob in one.sizes if name in values}
    return {
        name: float(np.clip(knob.null + stretch * (value - knob.null), knob.lower, knob.upper))
        if (knob := sizes.get(name)) is not None
        else value
        for name, value in values.items()
    }


def _twins(
    trials: Sequence[tuple[Candidate, dict[str, float], list[Complexes]]], changes: Sequence[Complexes]
) -> dict[Candidate, Candidate]:
    """Return the candidates that do exactly the same as another one of the same effect, with that other one."""
    whole = np.concatenate(changes)
    norm = np.linalg.norm(whole, axis=0)
    first: dict[Candidate, list[int]] = {}
    for k, (one, _, _) in enumerate(trials):
        first.setdefault(one, []).append(k)
    found: dict[Candidate, Candidate] = {}
    for one, own in first.items():
        for other, its in first.items():
            if other is one:
                break
            if other.effect.name != one.effect.name or other in found or len(own) != len(its):
                continue
            if all(
                abs(np.vdot(whole[:, a], whole[:, b]).real) >= _SAME * norm[a] * norm[b] > 0
                for a, b in zip(own, its, strict=True)
            ):
                found[one] = other
                break
    return found
