"""Screening of candidates: compute the gain of each effect at a few plausible sizes without fitting it."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.effects import EffectParameter
from ...engine.on_cores import on_cores
from ...error_model.error_columns import ErrorColumns
from ...error_model.error_sizes import USUAL, ErrorSizes
from ...error_model.marginal_fit import ONE_IN_TWENTY
from ...error_model.point_covariance import Kernel, PointErrors
from ..decision_rules import ABSORBED, NAMED
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.own_losses import drawn_by_losses
from ..hypotheses.problem import Candidate, Problem
from .trial_changes import changes_beside, lines_for, stretched

STRETCH = 2.5
"""Largest factor by which a change is scaled linearly; it may become as small as needed."""
_HIGHEST = 3.0
"""Standard deviations of ln size above the median up to which the change by a resonance is scaled: it is a branch in
parallel with the device, so that its change is linear in its strength."""
_SAME = 0.999999


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
    lines = lines_for(parent, candidates)
    made = [partial(changes_beside, problem, parent, one, lines.get(one.step, [])) for one in candidates]
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


def _furthest(one: Candidate, values: dict[str, float]) -> float:
    """Return the largest factor by which the change of a trial is scaled linearly."""
    if not one.resonates:
        return STRETCH
    name, knob = max(one.sizes, key=lambda size: values[size[0]] / size[1].expected[0])
    median, spread = knob.expected
    return max(STRETCH, median * float(np.exp(_HIGHEST * spread)) / values[name])


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
            best[one] = gain, stretched(one, values, stretch), survives
    same = {one: tuple(t for t, of in twins.items() if of == one) for one in best}
    found = [ScreenedCandidate(one, *promise, same[one]) for one, promise in best.items()]
    return sorted(found, key=lambda promise: -promise.gain)


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
