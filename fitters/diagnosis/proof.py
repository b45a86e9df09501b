"""The proof: misfit on what took no part in the fit, before and after."""

from collections.abc import Sequence

import numpy as np

from ...models.arrays import Reals
from ..descent import descend
from .problem import Candidate, Problem
from .search import AGAIN, Refit, finished
from .tries import resoftened

_FLAT = 1e-3
"""Slope of all residuals by a coordinate below which it is taken as not moving: a knob that rests at its limit."""


def held_out_chi2(problem: Problem, found: Refit) -> float:
    """Return the misfit per degree of freedom on what is held out, of a fit to everything else.

    Measured against noise and against what the fit itself says it does not know there: a resonance that was held out
    is predicted less well, and that is no fault of the model. A further resonance that lies there as a whole cannot be
    foretold at all: it stays as the whole recording has it, and only what else the fit says is put to the proof.
    """
    stay = unforeseen(problem, found)
    objective = resoftened(problem, found).without(problem.proof).objective(found.effects, found.values, stay)
    again = finished(found.effects, descend(objective, objective.coordinates.x, 1e-8, AGAIN))
    ratios = again.objective.log_ratios(again.descent.x)
    predicted = _predicted_variance(problem, again, stay)
    total = points = 0.0
    for recording, ratio, mask, variance in zip(problem.recordings, ratios, problem.proof, predicted, strict=True):
        re, im = (recording.noise**2 + part for part in variance)
        total += float(np.sum((ratio.real**2 / re + ratio.imag**2 / im)[mask])) / 2
        points += float(mask.sum())
    return total / max(points, 1.0)


def unforeseen(problem: Problem, found: Refit) -> tuple[Candidate, ...]:
    """Return the effects with a frequency of their own that was held out of every recording that shows them."""
    return tuple(one for one in found.effects if one.lines and _lies_in(problem, one, found))


def _lies_in(problem: Problem, effect: Candidate, found: Refit) -> bool:
    places = [found.values[name] for name in effect.lines]
    return all(
        mask[np.argmin(np.abs(recording.sweep.frequency - place))]
        for recording, mask in zip(problem.recordings, problem.proof, strict=True)
        if recording.step in effect.steps
        for place in places
    )


def _predicted_variance(problem: Problem, again: Refit, held: Sequence[Candidate]) -> list[tuple[Reals, Reals]]:
    """Return the variance of Re and Im of ln Z that the fitted coordinates' uncertainty makes, by recording."""
    determined = again.objective.jacobian(again.descent.x)
    scale = 1 / np.maximum(np.linalg.norm(determined, axis=0), _FLAT)
    normal: Reals = (determined * scale).T @ (determined * scale)
    inverse: Reals = np.asarray(np.linalg.pinv(normal, rcond=1e-12, hermitian=True), np.float64)
    covariance: Reals = inverse * np.outer(scale, scale)
    full = problem.objective(again.effects, again.values, held)
    J = full.jacobian(again.descent.x)
    found: list[tuple[Reals, Reals]] = []
    at = 0
    for recording in problem.recordings:
        n = recording.sweep.frequency.size
        rows = J[at : at + 2 * n] * np.tile(recording.sigma, 2)[:, None]
        variance = np.einsum("ij,jk,ik->i", rows, covariance, rows)
        found.append((variance[:n], variance[n:]))
        at += 2 * n
    return found
