"""Which two effects together would explain what neither does: the score test of all pairs, none fitted.

A search that takes the best effect first and then the best beside it misses pairs whose sum looks like a third one: a
lead and a stray capacitance, which drift imitates better than each of them alone.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from ....models.base.arrays import Reals
from .score_test import Score, together

_PAIRS = 4
"""How many pairs are worth a fit."""
_LOOKED_AT = 200
"""Pairs whose physical signs are asked for, the best first."""
_TELLS = 1e-2
"""Part of an effect that the constants must not imitate for its score to tell anything."""


@dataclass(frozen=True, eq=False)
class Pair:
    """Two candidates with what they promise together."""

    scores: tuple[Score, Score]
    gain: float
    """How much chi2 would fall."""
    start: dict[str, float]
    """First-order estimate of every parameter, by parameter."""


def promising(found: Sequence[Score], residual: Reals) -> list[Pair]:
    """Return the pairs that would explain most, best first; of the same two effects the best places only.

    `residual` is that of the fit at which the scores were taken, shape (R,).
    """
    felt = [score for score in found if score.survives > _TELLS]
    if len(felt) < 2:
        return []
    all_columns = np.hstack([score.columns for score in felt])
    gram, along = all_columns.T @ all_columns, -(all_columns.T @ residual)
    owner = np.repeat(np.arange(len(felt)), [score.columns.shape[1] for score in felt])
    ranked = sorted(
        (
            (_most(gram, along, np.isin(owner, (i, j))), i, j)
            for i, j in combinations(range(len(felt)), 2)
            if felt[i].candidate.effect is not felt[j].candidate.effect
        ),
        reverse=True,
    )
    signed = [_pair(felt[i], felt[j], residual) for _, i, j in ranked[:_LOOKED_AT]]
    best: dict[frozenset[str], Pair] = {}
    for pair in sorted(signed, key=lambda one: -one.gain):
        best.setdefault(frozenset(score.candidate.effect.name for score in pair.scores), pair)
    return list(best.values())[:_PAIRS]


def _most(gram: Reals, along: Reals, columns: NDArray[np.bool_]) -> float:
    """Return by how much chi2 would fall whatever the signs."""
    b = along[columns]
    return float(b @ np.linalg.lstsq(gram[columns][:, columns], b, rcond=1e-10)[0])


def _pair(one: Score, other: Score, residual: Reals) -> Pair:
    effect_parameters = (*one.felt, *other.felt)
    steps, gain = together(
        np.hstack([one.columns, other.columns]), residual, [knob for _, knob, _ in effect_parameters]
    )
    start = {**one.start, **other.start}
    firsts = {score.candidate.parameters[0] for score in (one, other)}
    for (name, knob, unit), step in zip(effect_parameters, steps, strict=True):
        if name in firsts or knob.from_nothing:  # what only shapes an effect stays where it was looked for
            start[name] = float(np.clip(knob.null + step * unit, knob.lower, knob.upper))
    return Pair((one, other), gain, start)
