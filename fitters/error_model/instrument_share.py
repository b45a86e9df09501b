"""Misfit as reported by fits: in units of noise, without the part that the analyzer's gain and phase explain."""

from collections.abc import Sequence

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ...models.sweep import Sweep
from ..engine.recording import Recording
from . import prior_scales as scales
from .smooth_basis import ends_of, smooth


def accuracy_of(sweep: Sweep) -> Reals:
    """Return the accuracy of ln |Z| and of the phase in rad, shape (N,).

    That of the sweep's settings: `accuracy`, else of gain and phase at each point (what else is specified for small
    and for large |Z| are residues in series and in parallel, as a fixture has them), else a 4294A's up to 1 MHz.
    """
    stated = sweep.settings.get("accuracy")
    if not stated:
        for name in ("gain_accuracy_relative", "accuracy_relative"):
            noted = sweep.per_point(name)
            if noted is not None:
                return noted
    return np.full(sweep.frequency.size, float(stated or scales.INSTRUMENT))


def chi2_beside_instrument(recordings: Sequence[Recording], ratios: Sequence[Complexes], parameters: int) -> float:
    """Return chi2 per degree of freedom of `ratios`, ln(Z_model/Z) of each recording, shape (N,).

    Gain and phase errors of the analyzer are smooth in frequency, common to the recordings of a session, and as large
    as specified (`accuracy_of`). Their likeliest values are subtracted, together with their effective number of degrees
    of freedom. Points of infinite noise are ignored. `parameters`: number of fitted parameters.
    """
    logs = [np.log(recording.sweep.frequency) for recording in recordings]
    ends = ends_of(logs)
    weights = [1 / recording.noise for recording in recordings]
    sizes = [accuracy_of(recording.sweep) for recording in recordings]
    basis = [
        size[:, None] * smooth(own, ends, scales.SLOW, scales.FEW_SLOW) for size, own in zip(sizes, logs, strict=True)
    ]
    B = np.concatenate([own * weight[:, None] for own, weight in zip(basis, weights, strict=True)])
    r = np.concatenate([own * weight for own, weight in zip(ratios, weights, strict=True)])
    normal = B.T @ B
    S = np.eye(len(normal)) + normal
    left = r - B @ np.linalg.solve(S, B.T @ r)
    points = sum(int(np.count_nonzero(weight)) for weight in weights)
    taken = float(np.trace(np.linalg.solve(S, normal)))
    return float(np.sum(np.abs(left) ** 2)) / max(1.0, 2 * points - parameters - 2 * taken)
