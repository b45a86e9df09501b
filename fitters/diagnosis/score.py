"""Score (Lagrange multiplier) tests: how much of the residual an effect would explain, without fitting it.

C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50. The derivative of the residuals by an effect's knobs, less what the free
constants can imitate of it, is held against the residuals; only the physical sign counts.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ...models.arrays import Reals
from ...models.effects import Knob
from ..objective import Objective
from .problem import Candidate, Problem

_SCANNED = 60
"""Frequencies at which a further resonance is looked for."""
_STEP = 1e-3


@dataclass(frozen=True, eq=False)
class Score:
    """What a candidate promises at the null fit."""

    candidate: Candidate
    gain: float
    """How much chi2 would fall."""
    survives: float
    """Part of the effect that the free constants cannot imitate, 0 to 1 (of its root mean square)."""
    size: float
    """Root mean square of d residual / d typical size of the first knob: how visible it is at all."""
    value: float
    """First-order estimate of the first knob."""
    start: dict[str, float]
    """Values of the other knobs at which the score was taken, by parameter."""
    shifts: Reals
    """What the free coordinates do, per unit of the first knob, where the effect is there and ignored."""
    surviving: Reals
    """The direction that survives, normalised; zero where nothing does."""


def scores(problem: Problem, candidates: Sequence[Candidate], null: Objective, x: Reals) -> list[Score]:
    """Return the scores of all candidates at the null fit `x`, largest gain first."""
    r, J = null.residual(x), null.jacobian(x)
    Q, R = np.linalg.qr(J)
    values, _ = null.coordinates.forward(x)
    found = [_score(problem, candidate, values, r, Q, R) for candidate in candidates]
    return sorted(found, key=lambda score: -score.gain)


def _score(problem: Problem, candidate: Candidate, values: dict[str, float], r: Reals, Q: Reals, R: Reals) -> Score:
    start = _tuned(problem, candidate, values, r, Q)
    G = _knob_columns(problem, candidate, {**values, **start}, r.size)
    held = Q.T @ G
    outside = G - Q @ held
    first, size = candidate.knobs[0], float(np.sqrt(np.mean(G[:, 0] ** 2)))
    norm = float(np.linalg.norm(outside[:, 0]))
    step = float(outside[:, 0] @ -r) / norm**2 if norm > 0 else 0.0
    if first.lower == first.null:
        step = max(step, 0.0)
    gain = step**2 * norm**2
    if G.shape[1] > 1:
        gain = max(gain, _several(outside, r))
    return Score(
        candidate,
        gain=gain,
        survives=norm / max(float(np.linalg.norm(G[:, 0])), 1e-300),
        size=size,
        value=step * first.typical,
        start=start,
        shifts=np.asarray(np.linalg.lstsq(R, held[:, 0], rcond=None)[0], np.float64) / -first.typical,
        surviving=outside[:, 0] / norm if norm > 0 else outside[:, 0],
    )


def _tuned(problem: Problem, candidate: Candidate, values: dict[str, float], r: Reals, Q: Reals) -> dict[str, float]:
    """Return the values of the other knobs at which the first one explains most: a matched scan.

    For knobs in which an effect is far from linear: the frequency and quality of a resonance, the delay of an echo.
    """
    names = [candidate.prefix + knob.name for knob in candidate.knobs]
    grids = [_grid(problem, knob) for knob in candidate.knobs[1:]]
    best, start = -1.0, dict(zip(names[1:], (knob.null for knob in candidate.knobs[1:]), strict=True))
    if all(len(grid) == 1 for grid in grids):
        return start
    for combination in product(*grids):
        trial = dict(zip(names[1:], combination, strict=True))
        g = _first_column(problem, candidate, {**values, **trial}, r.size)
        outside = g - Q @ (Q.T @ g)
        norm = float(np.linalg.norm(outside))
        gain = max(0.0, float(outside @ -r)) / norm if norm > 0 else 0.0
        if gain > best:
            best, start = gain, trial
    return start


def _grid(problem: Problem, knob: Knob) -> tuple[float, ...]:
    """Return the values of a knob to scan: those it names, of a frequency a grid, else where it rests."""
    if knob.scan:
        return knob.scan
    if knob.unit == "Hz":
        low = min(float(recording.sweep.frequency[0]) for recording in problem.recordings)
        high = max(float(recording.sweep.frequency[-1]) for recording in problem.recordings)
        return tuple(np.geomspace(low, high, _SCANNED).tolist())
    return (knob.null,)


def _first_column(problem: Problem, candidate: Candidate, values: dict[str, float], rows: int) -> Reals:
    """Return d residual / d first knob, in typical sizes, shape (rows,), by one small step."""
    column = np.zeros(rows)
    knob, name, at = candidate.knobs[0], candidate.parameters[0], 0
    for recording in problem.with_effects([candidate]):
        n = recording.sweep.frequency.size
        if recording.step in candidate.steps:
            own = recording.model.parameters()
            device = recording.model.replace({key: value for key, value in values.items() if key in own})
            pair = [
                device.replace({name: knob.null + step * knob.typical}).impedance(recording.sweep.frequency)
                for step in (0.0, _STEP)
            ]
            weighted = np.log(pair[1] / pair[0]) / (_STEP * recording.sigma)
            column[at : at + n], column[at + n : at + 2 * n] = weighted.real, weighted.imag
        at += 2 * n
    return column


def _several(outside: Reals, r: Reals) -> float:
    """Return the gain of all knobs together, whatever their signs."""
    step, *_ = np.linalg.lstsq(outside, -r, rcond=1e-8)
    return float(np.sum(r**2) - np.sum((r + outside @ step) ** 2))


def _knob_columns(problem: Problem, candidate: Candidate, values: dict[str, float], rows: int) -> Reals:
    """Return d residual / d knob, in typical sizes, shape (rows, knobs); priors do not depend on knobs."""
    columns = np.zeros((rows, len(candidate.knobs)))
    at = 0
    typical = np.array([knob.typical for knob in candidate.knobs])
    for recording in problem.with_effects([candidate]):
        n = recording.sweep.frequency.size
        if recording.step in candidate.steps:
            own = recording.model.parameters()
            device = recording.model.replace({name: value for name, value in values.items() if name in own})
            _, dlnZ = device.jacobian(recording.sweep.frequency, candidate.parameters)
            weighted = dlnZ.T * typical / recording.sigma[:, None]
            columns[at : at + n], columns[at + n : at + 2 * n] = weighted.real, weighted.imag
        at += 2 * n
    return columns
