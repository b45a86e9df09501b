"""The misfit of a hypothesis, with the errors that remain beside the named explanation."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ....models.base.arrays import Impedances
from ..errors.pair_errors import PairErrors
from ..errors.pair_sizes import USUAL_REST, Sizes
from .fitted import Fitted

_BLOCKS, _HELD = 11, (3, 8)
"""Of eleven contiguous blocks, those held out to validate an explanation."""


def predicted_without(fit: Fitted, k: int) -> Impedances:
    """Return the prediction without change `k`, all others as they are, ohm, shape (N,)."""
    pair, x = fit.errors.pair, np.delete(fit.x, np.r_[fit.hypothesis.slices[k]])
    return fit.hypothesis.without(k).predict(pair.before, pair.frequency, x, fit.errors.own)


def chi2(errors: PairErrors, fit: Fitted, sizes: Sizes) -> float:
    """Return the misfit in units of noise and errors of these sizes, for each number."""
    return fit.errors.quadratic(fit.at, sizes) / (2 * errors.pair.frequency.size)


def errors_beside(named: Fitted) -> Sizes:
    """Return the sizes of the errors beside an explanation, with which all others are compared to it."""
    return replace(named.outcome.sizes, rest=min(named.outcome.sizes.rest, USUAL_REST))


def held_out(count: int) -> tuple[tuple[int, int], ...]:
    """Return the first and one past the last point of each held-out block."""
    edges = np.linspace(0, count, _BLOCKS + 1).round().astype(int)
    return tuple((int(edges[k]), int(edges[k + 1])) for k in _HELD)


def held_out_chi2(fit: Fitted, held: Sequence[tuple[int, int]], sizes: Sizes) -> float:
    """Return the increase of the minimal chi2 by the held-out points, for each number (Chow's test)."""
    rest = fit.errors.without(held).quadratic(fit.at, sizes)
    count = 2 * sum(b - a for a, b in held)
    return (fit.errors.quadratic(fit.at, sizes) - rest) / count
