"""Score (Lagrange multiplier) tests: how much of the residual an effect would explain, without fitting it.

C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50. Derivatives of the residuals by an effect's parameters, less what free
constants can imitate of it, is held against the residuals; only the physical sign counts.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from scipy.optimize import lsq_linear

from ....models.base.arrays import Frequencies, Impedances, Reals
from ....models.base.model import Model
from ....models.effects import Device, EffectParameter, Stage
from ...engine.objective import Objective
from ...engine.recording import Recording
from ..hypotheses.problem import Candidate, Problem

_SCANNED = 240
"""Frequencies at which a further resonance is looked for: closer than the width of a line of Q = 60."""
_STEP = 1e-3
_FELT = 1e-6
"""Relative to the most sensitive parameter: anything less is rounding of a parameter without influence yet."""


@dataclass(frozen=True, eq=False)
class Score:
    """What a candidate promises at the null fit."""

    candidate: Candidate
    gain: float
    """How much chi2 would fall."""
    survives: float
    """Part of the effect that the free constants cannot imitate, 0 to 1 (of its root mean square)."""
    size: float
    """Root mean square of d residual / d typical size of the first parameter: how visible it is at all."""
    value: float
    """First-order estimate of the first parameter."""
    start: dict[str, float]
    """Values of the other parameters at which the score was taken, by parameter."""
    columns: Reals
    """d residual / d parameter of the sensitive parameters, orthogonal to the free constants; each of norm 1."""
    felt: tuple[tuple[str, EffectParameter, float], ...]
    """Parameter, parameter, and its change per unit of its column."""
    shifts: Reals
    """What the free coordinates do, per unit of the first parameter, where the effect is there and ignored."""


def scores(problem: Problem, candidates: Sequence[Candidate], null: Objective, x: Reals) -> list[Score]:
    """Return the scores of all candidates at the null fit `x`, largest gain first."""
    r, J = null.residual(x), null.jacobian(x)
    Q, R = np.linalg.qr(J)
    values, _ = null.coordinates.forward(x)
    scan = _Scan(problem, values, r, Q)
    found = [_score(problem, candidate, values, r, Q, R, scan.tuned(candidate)) for candidate in candidates]
    return sorted(found, key=lambda score: -score.gain)


def _score(
    problem: Problem, candidate: Candidate, values: dict[str, float], r: Reals, Q: Reals, R: Reals, tuned: list[float]
) -> Score:
    start = dict(zip(candidate.parameters[1:], tuned, strict=True))
    G = _knob_columns(problem, candidate, {**values, **start}, r.size)
    held = Q.T @ G
    outside = G - Q @ held
    first, size = candidate.effect_parameters[0], float(np.sqrt(np.mean(G[:, 0] ** 2)))
    norm = float(np.linalg.norm(outside[:, 0]))
    step = float(outside[:, 0] @ -r) / norm**2 if norm > 0 else 0.0
    if first.from_nothing:
        step = max(step, 0.0)
    gain = step**2 * norm**2
    norms = np.linalg.norm(outside, axis=0)
    felt = np.flatnonzero(norms > _FELT * max(float(np.max(norms)), 1e-300))
    columns, own = outside[:, felt] / norms[felt], [candidate.effect_parameters[k] for k in felt]
    if G.shape[1] > 1:
        steps, fall = together(columns, r, own)
        gain = max(gain, fall)
        all_steps = np.zeros(len(candidate.effect_parameters))  # what is not felt stays at rest
        all_steps[felt] = steps / norms[felt]
        others = list(enumerate(candidate.effect_parameters))[1:]
        step = float(all_steps[0])
        start |= {
            candidate.parameters[k]: float(np.clip(all_steps[k] * knob.typical, knob.lower, knob.upper))
            for k, knob in others
            if knob.from_nothing
        }
    return Score(
        candidate,
        gain=gain,
        survives=norm / max(float(np.linalg.norm(G[:, 0])), 1e-300),
        size=size,
        value=step * first.typical,
        start=start,
        columns=columns,
        felt=tuple((candidate.parameters[k], knob, knob.typical / norms[k]) for k, knob in zip(felt, own, strict=True)),
        shifts=np.asarray(np.linalg.lstsq(R, held[:, 0], rcond=None)[0], np.float64) / -first.typical,
    )


@dataclass(frozen=True, eq=False)
class _Scan:
    """Matched scans at one fit, none made twice: a line looks the same whichever layer it is said to sit in."""

    problem: Problem
    values: dict[str, float]
    r: Reals
    Q: Reals
    made: list[tuple[str, Reals, list[float]]] = field(default_factory=list[tuple[str, Reals, list[float]]])
    """Name of an effect, a first column, and the values found."""

    def tuned(self, candidate: Candidate) -> list[float]:
        """Return the values of the other parameters at which the first one explains most.

        For parameters in which an effect is far from linear: frequency and quality of a resonance, delay of an echo.
        """
        grids = [_grid(self.problem, knob) for knob in candidate.effect_parameters[1:]]
        if all(len(grid) == 1 for grid in grids):
            return [knob.null for knob in candidate.effect_parameters[1:]]
        column = _first_columns(self.problem, candidate, self.values, self.r.size)
        sample = column([grid[len(grid) // 2] for grid in grids])
        for name, known, found in self.made:
            if name == candidate.effect.name and np.allclose(sample, known, rtol=1e-6, atol=0.0):
                return found
        found = max(map(list, product(*grids)), key=lambda trial: self._explained(column(trial)))
        self.made.append((candidate.effect.name, sample, found))
        return found

    def _explained(self, g: Reals) -> float:
        outside = g - self.Q @ (self.Q.T @ g)
        norm = float(np.linalg.norm(outside))
        return max(0.0, float(outside @ -self.r)) / norm if norm > 0 else 0.0


def _grid(problem: Problem, knob: EffectParameter) -> tuple[float, ...]:
    """Return the values of a parameter to scan: those it names, of a frequency a grid, else where it rests."""
    if knob.scan:
        return knob.scan
    if knob.unit == "Hz":
        low = min(float(recording.sweep.frequency[0]) for recording in problem.recordings)
        high = max(float(recording.sweep.frequency[-1]) for recording in problem.recordings)
        return tuple(np.geomspace(low, high, _SCANNED).tolist())
    return (knob.null,)


def _first_columns(
    problem: Problem, candidate: Candidate, values: dict[str, float], rows: int
) -> Callable[[Sequence[float]], Reals]:
    """Return a function of the other parameters: d residual / d first parameter in typical sizes, shape (rows,).

    By one small step from where the effect is absent, which is the same for all of them. What the sweep itself did is
    small, and left out unless it is what is looked for.
    """
    knob, name = candidate.effect_parameters[0], candidate.parameters[0]
    size, at = knob.null + _STEP * knob.typical, 0
    places: list[tuple[int, Recording, Model, Impedances]] = []
    for plain, recording in zip(problem.recordings, problem.with_effects([candidate]), strict=True):
        f = recording.sweep.frequency
        if recording.step in candidate.steps:
            there, absent = _moved(recording.model, {**values, name: size}), _moved(plain.model, values)
            places.append((at, recording, there, _seen(absent, candidate, f)))
        at += 2 * f.size

    def column(others: Sequence[float]) -> Reals:
        made, trial = np.zeros(rows), dict(zip(candidate.parameters[1:], others, strict=True))
        for at, recording, there, absent in places:
            f = recording.sweep.frequency
            weighted = np.log(_seen(there.replace(trial), candidate, f) / absent) / (_STEP * recording.sigma)
            made[at : at + f.size], made[at + f.size : at + 2 * f.size] = weighted.real, weighted.imag
        return made

    return column


def _seen(model: Model, candidate: Candidate, f: Frequencies) -> Impedances:
    if candidate.effect.stage < Stage.ACQUISITION and isinstance(model, Device):
        return model.steady_impedance(f)
    return model.impedance(f)


def _moved(model: Model, values: dict[str, float]) -> Model:
    own = model.parameters()
    return model.replace({name: value for name, value in values.items() if name in own})


def together(columns: Reals, r: Reals, effect_parameters: Sequence[EffectParameter]) -> tuple[Reals, float]:
    """Return the steps along `columns`, those of sizes not negative, by which chi2 falls most, and how far it falls."""
    if not columns.shape[1]:
        return np.zeros(0), 0.0
    Q, R = np.linalg.qr(columns)
    b = -(Q.T @ r)
    lower = np.array([0.0 if knob.from_nothing else -np.inf for knob in effect_parameters])
    step = np.asarray(lsq_linear(R, b, (lower, np.inf), method="bvls").x, np.float64)
    return step, float(b @ b - np.sum((R @ step - b) ** 2))


def _knob_columns(problem: Problem, candidate: Candidate, values: dict[str, float], rows: int) -> Reals:
    """Return d residual / d parameter in typical sizes, shape (rows, parameters); priors do not depend on them."""
    columns = np.zeros((rows, len(candidate.effect_parameters)))
    at = 0
    typical = np.array([knob.typical for knob in candidate.effect_parameters])
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
