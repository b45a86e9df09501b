"""The findings of a comparison: each change of the explanation with its probability, sizes and rivals."""

from collections.abc import Sequence

import numpy as np

from ....models.base.arrays import Reals
from ....models.base.true_runs import true_runs
from ...diagnosis.findings import Alternative, Bands, Size
from ..comparison import ChangeFinding
from ..errors.pair_errors import PairErrors
from ..hypotheses.fit import fitted
from ..hypotheses.fitted import Fitted
from ..hypotheses.hypothesis import Change, Hypothesis
from ..hypotheses.misfit import chi2, errors_beside, held_out_chi2, predicted_without
from ..hypotheses.search import Searched
from ..known_changes.two_ports import TwoPort
from ..pair import Pair
from ..with_build.model_change import ModelChange


def findings_of(
    errors: PairErrors,
    searched: Searched,
    fits: tuple[Fitted, Fitted],
    known: tuple[Sequence[int], Sequence[tuple[int, int]]],
) -> tuple[ChangeFinding, ...]:
    """Return the findings; `known` are the look-alike hypotheses and the held-out points.

    `fits`: the explanation that is named, and that with what is negligible beside it, which has the better sizes.
    """
    named, whole = fits
    chances = searched.probabilities()
    alike, held = known
    made: list[ChangeFinding] = []
    sizes = errors_beside(named)
    for k, change in enumerate(named.hypothesis.changes):
        others = tuple(c for j, c in enumerate(named.hypothesis.changes) if j != k)
        without = fit_without(errors, searched, others)
        ratio = np.log(named.at.predicted / predicted_without(named, k))
        rivals = _rivals(searched, chances, change, others, range(len(searched.fits)))
        made.append(
            ChangeFinding(
                effect=change.effect,
                where=change.where,
                step=change.found.described.step if isinstance(change, ModelChange) else "",
                probability=probability_of(searched, chances, change, alike),
                bands_Hz=_bands(errors.pair, ratio),
                parameters=_sizes(whole, whole.hypothesis.changes.index(change)),
                chi2_per_dof_before=chi2(errors, without, sizes),
                chi2_per_dof_after=chi2(errors, named, sizes),
                held_out_before=held_out_chi2(without, held, sizes),
                held_out_after=held_out_chi2(named, held, sizes),
                alternatives=rivals,
                says=change.says + _twins(searched, change, others, alike),
                share=1 - chi2(errors, named, sizes) / chi2(errors, without, sizes),
                same_as=_rivals(searched, chances, change, others, alike),
                moves=float(np.sqrt(np.mean(np.abs(ratio) ** 2))),
                removed=isinstance(change, TwoPort | ModelChange) and change.taken,
            )
        )
    return tuple(made)


def fit_without(errors: PairErrors, searched: Searched, others: tuple[Change, ...]) -> Fitted:
    """Return the fit with all but one of the changes."""
    known = next((one for one in searched.fits if one.hypothesis.changes == others), None)
    return known or fitted(Hypothesis(others), errors, np.zeros(sum(len(one.sizes) for one in others)))


def probability_of(searched: Searched, chances: Reals, change: Change, alike: Sequence[int]) -> float:
    """Return the posterior share of all hypotheses that contain an effect at its place or a look-alike."""
    key = change.effect, change.where
    return float(
        sum(
            chance
            for k, (one, chance) in enumerate(zip(searched.fits, chances, strict=True))
            if k in alike or any((c.effect, c.where) == key for c in one.hypothesis.changes)
        )
    )


def _rivals(
    searched: Searched, chances: Reals, change: Change, others: tuple[Change, ...], among: Sequence[int]
) -> tuple[Alternative, ...]:
    """Return the changes that replace a change in other hypotheses, with the posterior share of each."""
    taken = {change.effect, *(one.effect for one in others)}
    shares: dict[tuple[str, str], float] = {}
    for k in among:
        changes = searched.fits[k].hypothesis.changes
        for one in () if any(c.effect == change.effect for c in changes) else changes:
            if one.effect not in taken:
                key = one.effect, one.where
                shares[key] = shares.get(key, 0.0) + float(chances[k])
    ranked = sorted(shares.items(), key=lambda item: -item[1])
    return tuple(Alternative(effect, where, share) for (effect, where), share in ranked[:8])


def _twins(searched: Searched, change: Change, others: tuple[Change, ...], alike: Sequence[int]) -> str:
    """Return sentences on other places at which the same change would look the same."""
    keys = [(one.effect, one.where) for one in (change, *others)]
    fits = [searched.fits[k].hypothesis.changes for k in alike]
    same = [one for changes in fits if len(changes) == len(keys) for one in changes if one.effect == change.effect]
    places = dict.fromkeys(one.where for one in same if (one.effect, one.where) not in keys)
    return "".join(f" At {place} it would look the same." for place in places)


def _sizes(fit: Fitted, k: int) -> dict[str, Size]:
    """Return the sizes of a change and the derived values."""
    change, own = fit.hypothesis.changes[k], fit.hypothesis.slices[k]
    made = {name: Size(value, u, unit) for name, (value, u, unit) in fit.sizes(k).items()}
    if isinstance(change, TwoPort | ModelChange) and change.derived is not None:
        total, every = fit.reported
        covariance = every[own, own]
        values = fit.hypothesis.values(total, k)
        for name, (value, unit) in change.derived(values).items():
            slopes = np.zeros(covariance.shape[0])
            for j in range(slopes.size):
                moved = total.copy()
                moved[own.start + j] += 1e-4
                slopes[j] = (change.derived(fit.hypothesis.values(moved, k))[name][0] - value) / 1e-4
            made[name] = Size(value, float(np.sqrt(max(slopes @ covariance @ slopes, 0.0))), unit)
    return made


def turned_in_file(pair: Pair) -> tuple[ChangeFinding, ...]:
    """Return the finding that only one of the recordings is inverted in its file."""
    if pair.turned[0] == pair.turned[1]:
        return ()
    which = "before" if pair.turned[0] else "after"
    how = pair.turned[0] or pair.turned[1]
    says = f"The recording of {which} is {how} in its file; it was put right before it was compared."
    nan = float("nan")
    whole = ((float(pair.frequency[0]), float(pair.frequency[-1])),)
    return (ChangeFinding("polarity", "terminals", "", 1.0, whole, {}, nan, nan, nan, nan, (), says, nan),)


def _bands(pair: Pair, effect: "np.ndarray[tuple[int], np.dtype[np.complex128]]") -> Bands:
    """Return at most three bands in which a change moves ln Z by more than half of its maximum."""
    size = np.abs(effect)
    pairs = sorted(true_runs(size > 0.5 * size.max()), key=lambda edge: -float(np.sum(size[edge[0] : edge[1]])))[:3]
    return tuple((float(pair.frequency[a]), float(pair.frequency[b - 1])) for a, b in pairs)
