"""The search for changes: each change alone, then the best ones with one more change at either end, repeatedly."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import exp, log

import numpy as np

from ....models.base.arrays import Reals
from ...diagnosis.data_quality.pole_fit import PoleFit
from ...diagnosis.decision_rules import COARSENED
from ..errors.pair_errors import PairErrors
from ..errors.pair_sizes import USUAL
from ..known_changes.another_device import ODDS, every_resonance, log_odds_of_nothing_in_common
from ..with_build.model_change import ModelChange
from .fit import fitted, plain_fit, plain_misfit, screened
from .fitted import Fitted
from .hypothesis import Change, Hypothesis

_TRIED = 2
"""Number of starts that are followed."""
_FITTED, _NEAR = 4, 15.0
"""Number of hypotheses fitted with the error model, and the range in nats below the best for more. A budget."""
_WORTH, _INACCURATE = 0.1, 100.0
"""Largest distance of those from the best, relative to what the best gains, or in nats: a screening is this accurate,
which takes drift for linear."""
_HOPELESS = 100.0
"""Residual relative to the smallest one beyond which no drift makes up for it: a start is sought with 3e-4 of drift."""
_PARENTS, _SCREENED, _GROWN = 2, 8, 4
"""Number of best hypotheses that are extended; of each one's extensions, numbers screened and fitted. Budgets."""
_MOST = 3
"""Most changes in a hypothesis. A budget."""
_QUIET = 1.25
"""Noise relative to its estimate up to which an explanation may be complete."""
_NOISE_ALONE = 1.2
"""chi2 per number up to which the residual is only noise."""
_NOTHING_ELSE = 0.99
"""Fraction of the evidence with a usual rest above which an explanation is complete."""
_PAYS = 5.0
"""Gain in ln evidence and prior odds by a further change that is needed to continue."""


@dataclass(frozen=True, eq=False)
class Searched:
    """All hypotheses that were fitted, the most probable first."""

    fits: tuple[Fitted, ...]
    nothing: Fitted
    apart: float
    """Probability that the recordings have nothing in common."""

    @property
    def best(self) -> Fitted:
        """The most probable."""
        return self.fits[0]

    @cached_property
    def coarseness(self) -> float:
        """Amount of ln evidence that counts as one nat.

        If even the best explanation leaves more than noise and usual errors, differences in evidence count
        correspondingly less (a coarsened posterior, as in a diagnosis: `decision_rules.COARSENED`).
        """
        return 1 + COARSENED * self.best.shortfall

    def probabilities(self) -> Reals:
        """Return the posterior probability of each, shape (K,)."""
        logs = np.array([one.weight(self.coarseness) for one in self.fits])
        return (1 - self.apart) * np.exp(logs - np.logaddexp.reduce(logs))


def search(errors: PairErrors, changes: Sequence[Change], after: PoleFit) -> Searched:
    """Return the hypotheses fitted to a pair; `after`: poles of the second recording, found from those of the first."""
    nothing = _unchanged(errors)
    fits: dict[tuple[Change, ...], Fitted] = {(): nothing}
    singles = [Hypothesis((change,)) for change in changes]
    starts = [(one, *_started(one, errors, np.zeros(0), 0)) for one in singles]
    for hypothesis, x in _promising(_possible(starts), errors, nothing):
        fits[hypothesis.changes] = fitted(hypothesis, errors, x, nothing.outcome.sizes)
    for depth in range(1, _MOST):
        ranked = _ranked(fits.values())
        best = ranked[0]
        if len(best.hypothesis.changes) < depth or _whole(best) or (depth > 1 and not _short(best)):
            break
        parents = _parents([one for one in ranked if len(one.hypothesis.changes) == depth], errors)
        for parent in parents:
            for hypothesis, x in _grown(parent, errors, changes):
                if hypothesis.changes not in fits:
                    fits[hypothesis.changes] = fitted(hypothesis, errors, x, parent.outcome.sizes)
            fits[parent.hypothesis.changes] = _again(parent, fits.values(), errors)
        if _ranked(fits.values())[0].log_posterior < best.log_posterior + _PAYS:
            break
    if _nothing_else(_ranked(fits.values())[0]):
        return Searched(tuple(_ranked(fits.values())), nothing, 0.0)
    every = every_resonance(errors.recorded, errors.own, after)
    if every is not None:
        hypothesis = Hypothesis((every[0],))
        fits[hypothesis.changes] = fitted(hypothesis, errors, plain_fit(hypothesis, errors, every[1])[1])
    ranked = tuple(_ranked(fits.values()))
    return Searched(ranked, nothing, nothing_in_common(ranked[0]))


def _unchanged(errors: PairErrors) -> Fitted:
    """Return the hypothesis without any change.

    Both recordings show the device bare then, so that its drift may be that of either one's resonances: of those that
    describe it better.
    """
    sides = (errors, errors.from_after())
    return max((fitted(Hypothesis(()), one, np.zeros(0)) for one in sides), key=lambda fit: fit.log_posterior)


def _again(parent: Fitted, fits: Iterable[Fitted], errors: PairErrors) -> Fitted:
    """Return an explanation, fitted again from its best extension if that has a further change without a size.

    Such a change explains nothing, so the better fit was there without it and had not been found.
    """
    own = parent.hypothesis.changes
    larger = [one for one in fits if not one.possible and set(own) < set(one.hypothesis.changes)]
    best = max(larger, key=lambda one: one.outcome.log_evidence, default=parent)
    if best.outcome.log_evidence < parent.outcome.log_evidence + _PAYS:
        return parent
    places = [best.hypothesis.slices[best.hypothesis.changes.index(change)] for change in own]
    x = np.concatenate([best.x[place] for place in places])
    return max(parent, fitted(parent.hypothesis, errors, x, best.outcome.sizes), key=lambda one: one.log_posterior)


def _nothing_else(best: Fitted) -> bool:
    """Return whether an explanation leaves only usual errors; another device is then excluded."""
    return best.outcome.usual >= _NOTHING_ELSE and best.shortfall == 0.0


def nothing_in_common(fit: Fitted) -> float:
    """Return the probability, relative to an explanation, that the recordings have nothing in common."""
    if _nothing_else(fit):
        return 0.0
    odds = log_odds_of_nothing_in_common(fit.errors, fit.at, fit.outcome, fit.shortfall)
    odds += log(ODDS) - fit.hypothesis.log_prior
    return 1 / (1 + exp(-max(min(odds, 700.0), -700.0)))


def _parents(ranked: Sequence[Fitted], errors: PairErrors) -> list[Fitted]:
    """Return the hypotheses to extend: the most probable, and those with the smallest residual at equal weights."""
    plain = sorted(ranked, key=lambda one: plain_misfit(one.hypothesis, errors, one.x))
    chosen: dict[int, Fitted] = {}
    for one in (*ranked[: _PARENTS - 1], *plain):
        if len(chosen) < _PARENTS and all(one.hypothesis.names != other.hypothesis.names for other in chosen.values()):
            chosen[id(one)] = one
    return list(chosen.values())


def _ranked(fits: Iterable[Fitted]) -> list[Fitted]:
    return sorted(fits, key=lambda one: -one.log_posterior)


def _whole(best: Fitted) -> bool:
    """Return whether an explanation leaves only noise and small errors; the search then ends."""
    sizes, numbers = best.outcome.sizes, 2 * best.errors.pair.frequency.size
    small = sizes.rest == 0 and sizes.noise <= _QUIET and sizes.instrument <= 1 and sizes.shape <= USUAL.shape
    small = small and max(sizes.drift, sizes.strength, sizes.wander) <= USUAL.wander
    return small and best.outcome.cost < _NOISE_ALONE * numbers


def _short(best: Fitted) -> bool:
    """Return whether an explanation leaves more than noise."""
    return best.outcome.sizes.rest > 0


def _grown(parent: Fitted, errors: PairErrors, changes: Sequence[Change]) -> list[tuple[Hypothesis, Reals]]:
    """Return the most promising extensions of an explanation by one change."""
    own = parent.hypothesis.changes
    trials: list[tuple[float, Hypothesis, Reals]] = []
    for change in changes:
        if any(one.effect == change.effect or _exclude(one, change) for one in own):
            continue
        for at in _places(own, change):
            hypothesis = Hypothesis((*own[:at], change, *own[at:]))
            value, x = _started(hypothesis, errors, parent.x, at, steps=5)
            trials.append((value, hypothesis, x))
    trials.sort(key=lambda trial: trial[0])
    ends = [(hypothesis, *plain_fit(hypothesis, errors, x)) for _, hypothesis, x in trials[:_SCREENED]]
    return _promising(ends, errors, parent)[:_GROWN]


def _promising(
    starts: Sequence[tuple[Hypothesis, float, Reals]], errors: PairErrors, parent: Fitted
) -> list[tuple[Hypothesis, Reals]]:
    """Return the hypotheses worth a fit with the error model, best first, with their starts.

    Those that only remove something are ranked by themselves, since their drift is that of the other recording.
    `starts`: hypotheses with residuals and results of plain least squares; `parent`: the one that they extend, or none.
    """
    chosen: list[tuple[float, Hypothesis, Reals]] = []
    least = min((value for _, value, _ in starts), default=0.0)
    for removes in (False, True):
        own = [one for one in starts if one[0].removes == removes]
        ends = [(*screened(one, errors, x, parent.outcome.sizes), one, value) for one, value, x in own]
        ends.sort(key=lambda end: -end[0])
        for k, (log_posterior, x, one, value) in enumerate(ends):
            behind = ends[0][0] - log_posterior
            worth = max(_WORTH * (ends[0][0] - parent.log_posterior), _INACCURATE)
            worth = np.inf if parent.hypothesis.changes else worth
            if behind < _NEAR or (k < _FITTED and behind < worth) or value == least:
                chosen.append((log_posterior, one, x))
    return [(one, x) for _, one, x in sorted(chosen, key=lambda trial: -trial[0])]


def _possible(starts: Sequence[tuple[Hypothesis, float, Reals]]) -> list[tuple[Hypothesis, float, Reals]]:
    """Return the hypotheses whose residual by plain least squares could be due to a drift."""
    least = min(value for _, value, _ in starts)
    return [one for one in starts if one[1] <= _HOPELESS * max(least, 1.0)]


def _places(own: tuple[Change, ...], change: Change) -> tuple[int, ...]:
    """Return the possible positions of a change among others: changes in the device precede those at the terminals."""
    first = sum(one.where != "terminals" for one in own)
    if change.where == "terminals":
        return tuple(range(first, len(own) + 1))
    return (first,) if isinstance(change, ModelChange) else (0,)


def _exclude(one: Change, other: Change) -> bool:
    """Return whether two changes cannot be in one model."""
    return isinstance(one, ModelChange) and isinstance(other, ModelChange) and (one.alone or other.alone)


def _started(hypothesis: Hypothesis, errors: PairErrors, known: Reals, at: int, steps: int = 12) -> tuple[float, Reals]:
    """Return results and residuals of plain least squares from the best starts of change `at`."""
    own = hypothesis.slices[at]
    base = np.concatenate([known[: own.start], np.zeros(own.stop - own.start), known[own.start :]])
    if own.start == own.stop:
        return plain_misfit(hypothesis, errors, base), base
    starts: list[tuple[float, Reals]] = []
    change = hypothesis.changes[at]
    pair = errors.pair
    state = Hypothesis(hypothesis.changes[:at]).states((pair.before, errors.own), pair.frequency, base)[-1]
    for coordinates in change.starts or [(float(z),) for z in change.sizes[0].lattice]:
        x = base.copy()
        x[own.start : own.start + len(coordinates)] = coordinates
        starts.append((plain_misfit(hypothesis, errors, x, (state, at)), x))
    lowest = sorted(starts, key=lambda start: start[0])
    apart = 0.6 if not change.sizes[0].signed else 0.0
    followed = [plain_fit(hypothesis, errors, x, steps) for _, x in _apart(lowest, own.start, apart)]
    return min(followed, key=lambda end: end[0])


def _apart(starts: list[tuple[float, Reals]], k: int, least: float) -> list[tuple[float, Reals]]:
    """Return the best starts that are not neighbours of each other."""
    kept: list[tuple[float, Reals]] = []
    for value, x in starts:
        if all(abs(x[k] - other[k]) > least for _, other in kept):
            kept.append((value, x))
        if len(kept) == _TRIED:
            break
    return kept
