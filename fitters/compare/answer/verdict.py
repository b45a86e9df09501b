"""The verdict of a comparison: which hypotheses are alike, what of the best one counts, how sure it is."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Reals
from ...diagnosis.decision_rules import CLASS_NATS, NAMED
from ..change import TERMINALS
from ..comparison import Verdict
from ..errors.drift import STRENGTH
from ..errors.instrument_errors import INSTRUMENT
from ..errors.pair_errors import PairErrors
from ..errors.pair_sizes import USUAL
from ..hypotheses.fitted import Fitted
from ..hypotheses.misfit import predicted_without
from ..hypotheses.search import Searched, nothing_in_common
from ..known_changes.another_device import ANOTHER, DEVICES_OF_A_KIND, NOTHING_IN_COMMON
from ..known_changes.device_changes import Scaled
from ..levels.drive_levels import AmplitudeDependent
from ..pair import Pair
from ..with_build.model_change import ModelChange
from .change_findings import fit_without, probability_of

_EXPLAINED = 0.1
"""Largest remainder, relative to the change (root mean square), of an explained change: 99 % of its power."""
_MISSED = 0.1**0.5
"""Remainder above which the best explanation explains too little to be named: a tenth of the change's power."""
_DRIFT, _WARM, _FEW = 3e-4, 1e-3, 0.01
"""Drift that two recordings of one device usually have; that of all frequencies by one factor, as by ten kelvin;
fraction of points that may differ by more than usual."""
_INSIDE, _FORMULA = 0.01, USUAL.shape
"""Relative to the largest change: a further change below this counts as an error of its formula. In the device; and at
the terminals, where both are smooth over frequency, as such errors are."""
SURE = 0.9
"""Smallest probability at which a change is reported."""
_ALIKE = 9.0
"""Two hypotheses whose predictions differ by less than this chi2 (three u) cannot be distinguished by a pair."""


def is_usual(errors: PairErrors, fit: Fitted, k: int) -> bool:
    """Return whether a change moves no point by more than the usual difference of two recordings of one device.

    Noise is not included in that difference, since it is known and accounted for separately.
    """
    change = fit.hypothesis.changes[k]
    if isinstance(change, AmplitudeDependent) and change.known:
        return False  # levels that differ are another reason than a usual difference
    if isinstance(change, Scaled):
        sizes = fit.hypothesis.values(fit.outcome.total, k)
        return abs(sizes["shift"]) < _WARM and abs(sizes["capacitance"]) < STRENGTH * _WARM
    moved = np.abs(np.log(fit.at.predicted / predicted_without(fit, k)))
    return bool(np.mean(moved > usual_difference(errors, fit)) < _FEW)


def usual_difference(errors: PairErrors, fit: Fitted) -> Reals:
    """Return by how much ln Z of two recordings of one device usually differs beside the noise, shape (N,)."""
    drift = _DRIFT * np.abs(fit.errors.slope)
    of = errors.instrument
    fixture = of.of_fixture(errors.pair.after)
    return np.sqrt((2 * INSTRUMENT) ** 2 + drift**2 + fixture**2 + of.of_calibration() ** 2)


def simplest(searched: Searched, alike: Sequence[int]) -> Fitted:
    """Return the hypothesis with the fewest changes among those that the pair cannot distinguish from the best."""
    return min((searched.fits[k] for k in alike), key=lambda one: len(one.hypothesis.changes), default=searched.nothing)


def substantial(searched: Searched, best: Fitted, errors: PairErrors) -> Fitted:
    """Return an explanation without changes that are negligible beside the others: errors of their formulas, or drift.

    The change of a model is taken to be as wrong as the model is.
    """
    changes = best.hypothesis.changes
    if len(changes) < 2:
        return best
    ratios = [np.abs(np.log(best.at.predicted / predicted_without(best, k))) for k in range(len(changes))]
    moves = [float(np.sqrt(np.mean(ratio**2))) for ratio in ratios]
    models = [one.found.described.rms_log_error for one in changes if isinstance(one, ModelChange)]
    parts = [_FORMULA if one.where == TERMINALS else max(_INSIDE, *models, 0) for one in changes]
    least = [part * max(moves) for part in parts]
    large = [k for k, size in enumerate(moves) if size > least[k] and not is_usual(errors, best, k)]
    kept = tuple(changes[k] for k in large or [int(np.argmax(moves))])
    return best if len(kept) == len(changes) else fit_without(errors, searched, kept)


def probable(errors: PairErrors, searched: Searched, best: Fitted, alike: Sequence[int]) -> Fitted:
    """Return an explanation without the changes that are less likely than not."""
    changes, chances = best.hypothesis.changes, searched.probabilities()
    if len(changes) < 2 or float(sum(chances[k] for k in alike)) >= NAMED:
        return best
    kept = tuple(one for one in changes if probability_of(searched, chances, one, ()) >= NAMED)
    return fit_without(errors, searched, kept) if kept else best


@dataclass(frozen=True)
class Told:
    """The verdict and its probabilities."""

    verdict: Verdict
    probability: float
    still: float
    """Probability that nothing changed."""
    named: float
    """Probability of the named changes."""
    other: str = ""
    """Sentence on the most probable unnamed explanation."""


def decided(searched: Searched, best: Fitted, alike: Sequence[int], pair: Pair) -> Told:
    """Return the verdict; the rest of the best explanation tells whether it is complete."""
    usual = searched.nothing.outcome.usual
    apart = max(searched.apart, nothing_in_common(best) if best.hypothesis.changes else 0.0)
    chances = searched.probabilities() * (1 - apart) / max(1 - searched.apart, 1e-300)
    nothing = float(chances[searched.fits.index(searched.nothing)])
    still = nothing * usual
    every = [(float(c), one.hypothesis) for one, c in zip(searched.fits, chances, strict=True)]
    kind = sum(c for c, one in every if ANOTHER in one.names)
    named = max(
        float(sum(chances[k] for k in alike)),
        min((probability_of(searched, chances, one, ()) for one in best.hypothesis.changes), default=0.0),
    )
    other = apart + kind + nothing * (1 - usual)
    says = max((apart, NOTHING_IN_COMMON), (kind, DEVICES_OF_A_KIND), (nothing * (1 - usual), ""))[1]
    if still >= max(named, other) or (still > 1 - SURE and named >= other):
        return Told("unchanged", still, still, named)
    if named < NAMED:
        return Told("unexplained", max(other, 1 - still - named), still, named, says)
    change = float(np.sqrt(np.mean(np.abs(pair.change) ** 2)))
    whole = best.shortfall == 0.0 or best.unexplained < _EXPLAINED * change
    if not whole and best.unexplained > _MISSED * change:
        return Told("unexplained", 1 - still, still, named, says)
    return Told("explained" if whole else "partly-explained", named, still, named)


def alike_with_best(searched: Searched, errors: PairErrors) -> list[int]:
    """Return the hypotheses that the pair cannot distinguish from the best: as probable, or equal to within errors."""
    fits = [one for one in searched.fits if one.hypothesis.changes and ANOTHER not in one.hypothesis.names]
    if not fits:
        return []
    best = fits[0]
    alike: list[int] = []
    for k, one in enumerate(searched.fits):
        if one not in fits:
            continue
        near = best.log_posterior - one.log_posterior
        if near < CLASS_NATS or (near < 15 and _difference(errors, best, one) < _ALIKE):
            alike.append(k)
    return alike


def _difference(errors: PairErrors, best: Fitted, one: Fitted) -> float:
    """Return the chi2 by which the predictions of two hypotheses differ, errors integrated out."""
    at = replace(best.at, slopes=best.at.slopes[:, :0], x=np.zeros(0), inside=(), offset=None)
    return errors.instead(one.at.predicted).quadratic(at, best.outcome.sizes)
