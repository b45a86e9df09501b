"""Score (Lagrange multiplier) tests: the part of the residual that an effect would explain, without fitting it.

C. R. Rao, Proc. Camb. Phil. Soc. 44 (1948) 50. The derivatives of the residuals by an effect's parameters, with the
free constants projected out, are compared with the residuals; only steps of the physical sign count.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import product

import numpy as np
from scipy.optimize import lsq_linear

from ....models.base.arrays import Complexes, Frequencies, Reals
from ....models.base.model import Model
from ....models.effects import Device, EffectParameter
from ...engine.objective import Objective
from ...engine.recording import Recording, log_ratio, recorded_band
from ..hypotheses.problem import Candidate, Problem

_SCANNED = 240
"""Number of trial frequencies of a further resonance: denser than the width of a line of Q = 60."""
_STEP = 1e-3
_FELT = 1e-6
"""Smallest relative sensitivity that is not rounding, compared with the most sensitive parameter."""


@dataclass(frozen=True, eq=False)
class Score:
    """Score test of a candidate at the null fit."""

    candidate: Candidate
    gain: float
    """Expected decrease of chi2."""
    survives: float
    """Part of the effect, 0 to 1 of its rms, that the free constants cannot imitate."""
    size: float
    """Rms of d residual / d (first parameter in typical sizes)."""
    value: float
    """First-order estimate of the first parameter."""
    start: dict[str, float]
    """Values of the other parameters at which the score was computed, by name."""
    columns: Reals
    """d residual / d parameter of the sensitive parameters, orthogonal to the free constants, normalised to 1."""
    felt: tuple[tuple[str, EffectParameter, float], ...]
    """Name, parameter, and its change per unit of its column, of the sensitive parameters."""
    shifts: Reals
    """Shift of the free coordinates, per unit of the first parameter, if the effect is present but ignored."""


def scores(
    problem: Problem, candidates: Sequence[Candidate], null: Objective, x: Reals, errors: Sequence[Complexes] = ()
) -> list[Score]:
    """Return the scores of all candidates at the null fit `x`, largest gain first.

    What each changes is seen on the devices of that fit, with all effects that it has. `errors`: columns of ln Z of
    each recording, shape (N, E), with coefficients of unit normal prior, that may imitate an effect as constants may.
    """
    problem = replace(problem, recordings=tuple(null.recordings))
    r, slopes = null.residual(x), null.jacobian(x)
    rows = r.size
    if errors:
        beside = _weighted(null.recordings, errors, rows)
        free = beside.shape[1]
        slopes = np.block([[slopes, beside], [np.zeros((free, slopes.shape[1])), np.eye(free)]])
        r = np.concatenate([r, np.zeros(free)])
    Q, R = np.linalg.qr(slopes)
    values, _ = null.coordinates.forward(x)
    scan = _Scan(problem, values, r, Q)
    found = [_score(problem, candidate, values, r, Q, R, scan.tuned(candidate)) for candidate in candidates]
    size = float(np.sqrt(r.size / rows))
    found = [replace(one, size=one.size * size, shifts=one.shifts[: x.size]) for one in found]
    return sorted(found, key=lambda score: -score.gain)


def _weighted(recordings: Sequence[Recording], columns: Sequence[Complexes], rows: int) -> Reals:
    """Return columns of ln Z of each recording in units of its noise, as rows of residuals, shape (rows, E)."""
    made, at = np.zeros((rows, columns[0].shape[1])), 0
    for recording, own in zip(recordings, columns, strict=True):
        n = recording.sweep.frequency.size
        weighted = own / recording.sigma[:, None]
        made[at : at + n], made[at + n : at + 2 * n] = weighted.real, weighted.imag
        at += 2 * n
    return made


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
    """Matched scans at one fit, with a cache: a line has the same shape whichever layer contains it."""

    problem: Problem
    values: dict[str, float]
    r: Reals
    Q: Reals
    made: list[tuple[str, Reals, list[float]]] = field(default_factory=list[tuple[str, Reals, list[float]]])
    """Name of an effect, its first column, and the values found."""

    def tuned(self, candidate: Candidate) -> list[float]:
        """Return the values of the other parameters at which the first one explains most.

        Needed for strongly nonlinear parameters: frequency and quality of a resonance, delay of an echo.
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
    """Return the scan values of a parameter: its own list, a grid for a frequency, else its rest value."""
    if knob.scan:
        return knob.scan
    if knob.unit == "Hz":
        low, high = recorded_band(problem.recordings)
        return tuple(np.geomspace(low, high, _SCANNED).tolist())
    return (knob.null,)


def _first_columns(
    problem: Problem, candidate: Candidate, values: dict[str, float], rows: int
) -> Callable[[Sequence[float]], Reals]:
    """Return a function of the other parameters: d residual / d first parameter in typical sizes, shape (rows,).

    The derivative is a difference quotient from the state without the effect, which all of them share. Faces count as
    parallel: it only chooses among hundreds of lines or masses, and all of them at each of fifty strips take minutes.
    """
    knob, name = candidate.effect_parameters[0], candidate.parameters[0]
    size, at = knob.null + _STEP * knob.typical, 0
    places: list[tuple[int, Recording, Model, Model]] = []
    for plain, recording in zip(problem.recordings, problem.with_effects([candidate]), strict=True):
        f = recording.sweep.frequency
        if recording.step in candidate.steps:
            there = _moved(_parallel(recording.model, candidate), {**values, name: size})
            absent = _moved(_parallel(plain.model, candidate), values)
            places.append((at, recording, there, absent))
        at += 2 * f.size

    def column(others: Sequence[float]) -> Reals:
        made, trial = np.zeros(rows), dict(zip(candidate.parameters[1:], others, strict=True))
        for at, recording, there, absent in places:
            f = recording.sweep.frequency
            weighted = _log_ratio(absent, there.replace(trial), f) / (_STEP * recording.sigma)
            made[at : at + f.size], made[at + f.size : at + 2 * f.size] = weighted.real, weighted.imag
        return made

    return column


def _parallel(model: Model, candidate: Candidate) -> Model:
    """Return the device with parallel faces, unless the candidate is what divides it into strips."""
    if not isinstance(model, Device) or candidate.effect.divides:
        return model
    return replace(model, added=tuple(one for one in model.added if not one.effect.divides))


def _log_ratio(absent: Model, there: Model, f: Frequencies) -> Complexes:
    if isinstance(absent, Device) and isinstance(there, Device):
        return absent.log_ratio(there, f)
    return log_ratio(there.impedance(f), absent.impedance(f))


def _moved(model: Model, values: dict[str, float]) -> Model:
    own = model.parameters()
    return model.replace({name: value for name, value in values.items() if name in own})


def together(columns: Reals, r: Reals, effect_parameters: Sequence[EffectParameter]) -> tuple[Reals, float]:
    """Return the steps along `columns` that minimise chi2, with signs constrained, and the decrease of chi2."""
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
