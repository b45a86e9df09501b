"""Effects that may be present undetected: the free constants absorb them, so a perfect fit does not exclude them.

The upper limit of each is what the recording allows (95 %), but no more than is plausible. An effect is listed if it
could shift a constant by more than the stated uncertainty.
"""

from collections.abc import Collection, Iterator, Sequence

import numpy as np

from ...interface import Constant
from ..findings import NotDecidable, Size
from ..search.refit import Refit, shift_of
from ..search.score_test import Score

_PLAUSIBLE = 4.0
"""Largest plausible size, in typical sizes; a careful lab would have noticed a larger effect."""
_ONE_SIDED_95 = 1.645
_ABSORBED = 0.1
"""Part of an effect outside the span of the free constants, below which it counts as absorbed."""


def not_decidable(
    found: Refit, scores: Sequence[Score], constants: dict[str, Constant], taken: set[str]
) -> tuple[NotDecidable, ...]:
    """Return the effects that this recording can neither show nor exclude, largest shift of a constant first."""
    listed: dict[str, tuple[float, NotDecidable]] = {}
    for score in scores:
        name = score.candidate.effect.name
        if name in taken or score.survives > _ABSORBED or score.size == 0:
            continue
        entry = _entry(found, score, constants)
        if entry is not None and (name not in listed or entry[0] > listed[name][0]):
            listed[name] = entry
    return tuple(entry for _, entry in sorted(listed.values(), key=lambda pair: -pair[0]))


def _entry(found: Refit, score: Score, constants: dict[str, Constant]) -> tuple[float, NotDecidable] | None:
    candidate, knob = score.candidate, score.candidate.effect_parameters[0]
    rows = float(np.sqrt(found.objective.residual(found.descent.x).size))
    sigma = knob.typical / max(score.survives * score.size * rows, 1e-300)
    limit = min(max(score.value, 0.0) + _ONE_SIDED_95 * sigma, _PLAUSIBLE * knob.typical, knob.upper)
    moved = shift_of(found.objective, found.descent.x, score.shifts * limit)
    worst, shifts = 0.0, dict[str, float]()
    for name, key, value, u in _parts(constants, moved):
        if key in moved:
            worst = max(worst, abs(moved[key]) / u)
            if abs(moved[key]) > 0.1 * u:
                shifts[name] = moved[key] / value
    if worst < 1:
        return None
    shown = candidate.effect.shown({k.name: limit if k is knob else k.null for k in candidate.effect_parameters})
    sizes = {name: Size(value, 0.0, unit) for name, (value, unit) in shown.items()}
    upper = sizes or {knob.name: Size(limit, 0.0, knob.unit)}
    return worst, NotDecidable(candidate.effect.name, candidate.where, upper, shifts, candidate.effect.separates)


def _parts(constants: dict[str, Constant], parameters: Collection[str]) -> Iterator[tuple[str, str, float, float]]:
    """Yield name, model parameter, value and uncertainty of every free real and imaginary part."""
    for name, constant in constants.items():
        lossy = f"{name}.im" in parameters
        if constant.free and constant.u_re:
            yield name, f"{name}.re" if lossy else name, constant.re, constant.u_re
        if constant.free and constant.u_im and constant.im and lossy:
            yield f"{name}.im", f"{name}.im", constant.im, constant.u_im
