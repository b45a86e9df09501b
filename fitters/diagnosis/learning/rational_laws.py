"""The rational passive form of a smooth correction: sums of growing order, with as many terms as evidence asks for.

Vector fitting moves the poles of a function and has to enforce passivity afterwards. Here poles stand on a grid, and
least squares without negative sizes (Lawson and Hanson) chooses among them, so that what it gives is passive.
"""

from collections.abc import Iterable
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from scipy.optimize import nnls

from ....models.base.arrays import Complexes, Reals
from ....models.effects.base.scale import resonance
from ....models.effects.learned.laws import Law
from ....models.effects.learned.rational import MOST_TERMS, rational, terms
from ....models.effects.learned.several import numbered
from ...error_model.error_columns import stack_of
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Problem
from .drawn_corrections import PlacedCorrection
from .law_fits import Made, best_fit, has_already, law_candidate

_POLES = 12
"""Number of relaxations tried over the recorded band."""
_INSIDE = 1.05
"""Smallest ratio of a relaxation to the ends of the band."""
_FLOOR = 0.03
"""Smallest uncertainty of a correction that is used, relative to its largest value."""
_PER_PARAMETER = 2.0
"""Decrease of chi2 that a parameter has to bring, among sums of one order."""


@dataclass(frozen=True, eq=False)
class _Term:
    """A law that can be part of a sum."""

    law: Law
    at: float | None
    """Its frequency over the reference, if it has one."""
    column: Reals
    """What it adds to the correction if its size is 1, over the correction's uncertainty, shape (2K,)."""


@dataclass(frozen=True, eq=False)
class _Sum:
    """A sum of terms that describes a correction."""

    terms: tuple[_Term, ...]
    sizes: Reals
    worth: float
    """chi2, with a price for every parameter."""

    @property
    def law(self) -> Law:
        """The sum as a law."""
        return rational([term.law for term in self.terms])

    def start(self) -> dict[str, float]:
        """Return its parameters in the law's units."""
        values: dict[str, float] = {}
        for k, (term, size) in enumerate(zip(self.terms, self.sizes, strict=True), 1):
            values[numbered("size", k)] = float(size)
            if term.at is not None:
                values[numbered("at", k)] = term.at
        return values


def rational_law(problem: Problem, parent: Hypothesis, placed: PlacedCorrection) -> Made | None:
    """Return the fit of the sum that describes a correction with most evidence; None if no sum describes it."""
    made: Made | None = None
    for one in _sums(problem, placed):
        more = _fitted(problem, parent, placed, one)
        if more is None or (made is not None and more[2].log_evidence <= made[2].log_evidence):
            break
        made = more
    return made


def _fitted(problem: Problem, parent: Hypothesis, placed: PlacedCorrection, one: _Sum) -> Made | None:
    law = one.law
    if has_already(problem, parent, placed.place, placed.steps, law):
        return None
    effect, candidate = law_candidate(problem, parent, placed.place, placed.steps, law)
    smooth = placed.hypothesis.effects[-1].prefix
    values = {name: value for name, value in placed.hypothesis.values.items() if not name.startswith(smooth)}
    start = {candidate.prefix + name: value for name, value in effect.physical(one.start()).items()}
    sizes = placed.hypothesis.fit.sizes, parent.fit.sizes
    best = best_fit(problem, parent, candidate, [(values, start)], sizes)
    return None if best is None else (effect, candidate, best)


def _sums(problem: Problem, placed: PlacedCorrection) -> Iterable[_Sum]:
    """Yield the best sum of two terms, and with one more term each."""
    x = placed.frequency / resonance(stack_of(problem.recordings[-1].model))
    u = np.hypot(np.hypot(placed.u_re, placed.u_im), _FLOOR * float(np.max(np.abs(placed.correction))))
    ends = float(x[0]) * _INSIDE, float(x[-1]) / _INSIDE
    tried = [
        _Term(law, at, _real(law.of(x, {"size": 1.0} if at is None else {"size": 1.0, "at": at}) / u))
        for law in terms(placed.place.quantity)
        for at in (np.geomspace(*ends, _POLES).tolist() if len(law.parameters) > 1 else [None])
    ]
    target = _real(placed.correction / u)
    best = _best(combinations(tried, 2), target)
    while best is not None:
        yield best
        more = ((*best.terms, one) for one in tried if one not in best.terms) if len(best.terms) < MOST_TERMS else ()
        best = _best(more, target)


def _best(tried: Iterable[tuple[_Term, ...]], target: Reals) -> _Sum | None:
    """Return the best of the sums that have no term without a size."""
    found: list[_Sum] = []
    for one in tried:
        sizes, left = nnls(np.stack([term.column for term in one], axis=1), target)
        if np.all(sizes > 0):
            count = sum(1 if term.at is None else 2 for term in one)
            found.append(_Sum(one, sizes, float(left) ** 2 + _PER_PARAMETER * count))
    return min(found, key=lambda one: one.worth, default=None)


def _real(columns: Complexes) -> Reals:
    return np.concatenate([columns.real, columns.imag])
