"""`compare`: what changed between two recordings of a device."""

import time
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Impedances, Reals
from ...models.base.true_runs import true_runs
from ...models.build import Build
from ...models.sweep import Sweep
from ..diagnosis.decision_rules import CLASS_NATS, NAMED
from ..diagnosis.findings import Alternative, Bands, Remaining, Size
from .another_device import ANOTHER, DEVICES_OF_A_KIND, NOTHING_IN_COMMON
from .change import TERMINALS
from .comparison import ChangeFinding, ComparedCurve, Comparison, DescribedBy, Verdict
from .device_changes import Scaled, device_changes
from .drift import STRENGTH
from .drive_levels import AmplitudeDependent, driven
from .fit import fitted
from .hypothesis import Change, Fitted, Hypothesis
from .limits import limits, repeatability
from .pair import Pair, pair_of, righted
from .pair_errors import INSTRUMENT, PairErrors
from .pair_sizes import USUAL, USUAL_REST, Sizes
from .resonances import Resonances, fitted_poles, resonances_of
from .search import Searched, nothing_in_common, search
from .shifts import resonance_shifts
from .two_ports import TwoPort, two_ports
from .with_build.build_changes import model_changes, step_before
from .with_build.found_device import FoundDevice
from .with_build.model_change import ModelChange

_BLOCKS, _HELD = 11, (3, 8)
"""Of eleven contiguous blocks, those held out to validate an explanation."""
_EXPLAINED = 0.1
"""Largest remainder, relative to the change (root mean square), of an explained change: 99 % of its power."""
_DRIFT, _WARM, _FEW = 3e-4, 1e-3, 0.01
"""Drift that two recordings of one device usually have; that of all frequencies by one factor, as by ten kelvin;
fraction of points that may differ by more than usual."""
_INSIDE, _FORMULA = 0.01, USUAL.shape
"""Relative to the largest change: a further change below this counts as an error of its formula. In the device; and at
the terminals, where both are smooth over frequency, as such errors are."""
_SURE = 0.9
"""Smallest probability at which a change is reported."""
_REMARKED = 0.1
"""Smallest probability at which an uncertain explanation is mentioned."""
_ALIKE = 9.0
"""Two hypotheses whose predictions differ by less than this chi2 (three u) cannot be distinguished by a pair."""


def compare(before: Sequence[Sweep], after: Sequence[Sweep], build: Build | None = None, step: str = "") -> Comparison:
    """Return what changed; several sweeps on a side are repeats. Raises TaskError if they cannot be compared.

    `build`: the device of which a `step` was recorded, so that changes inside can be named and sized. Raises FitError
    if it cannot be fitted.
    """
    began = time.monotonic()
    pair = pair_of(before, after)
    poles = fitted_poles(pair, pair.before, pair.noise_before)
    own = resonances_of(poles, pair, pair.before)
    after_poles = fitted_poles(pair, pair.after, pair.noise_after, poles)
    now = resonances_of(after_poles, pair, pair.after)
    levels = driven(pair, own, now)
    own = own if levels is None else levels.resonances
    errors = PairErrors(pair, (own, now))
    inside, described = ((), None) if build is None else _inside(build, step, pair, own, (before, after))
    searched = search(
        errors, (*two_ports(), *device_changes(pair, own), *([] if levels is None else [levels]), *inside), after_poles
    )
    found = concluded(errors, searched, began)
    return replace(found, resonances=resonance_shifts(pair, poles, after_poles), described_by=described)


def _inside(
    build: Build, step: str, pair: Pair, own: Resonances, sides: tuple[Sequence[Sweep], Sequence[Sweep]]
) -> tuple[tuple[ModelChange, ...], DescribedBy]:
    """Return the changes that the device of a build can have, and how the build describes it."""
    right = [[righted(one, turned) for one in side] for side, turned in zip(sides, pair.turned, strict=True)]
    first = FoundDevice.of(build, step, right[0], pair.before, own)
    second = FoundDevice.of(build, step, right[1], pair.after, own)
    earlier = step_before(build, step)
    stripped = None if earlier is None else FoundDevice.of(build, earlier, right[1], pair.after, own)
    return model_changes(build, (first, second), stripped, pair.levels), first.described


def concluded(errors: PairErrors, searched: Searched, began: float) -> Comparison:
    """Return the answer."""
    pair, nothing = errors.pair, searched.nothing
    alike = _class(searched, errors)
    whole = _simplest(searched, alike)
    best = _probable(errors, searched, _substantial(searched, whole, errors), alike)
    told = _told(searched, best, alike, pair)
    verdict, named = told.verdict, nothing if told.verdict in ("unchanged", "unexplained") else best
    held = _held_out(pair.frequency.size)
    findings = _findings(errors, searched, (best, whole), (alike, held)) if best.hypothesis.changes else ()
    remarks: tuple[ChangeFinding, ...] = ()
    if verdict == "explained" and all(_usual(errors, named, k) for k in range(len(named.hypothesis.changes))):
        verdict, named = "unchanged", nothing
        told = replace(told, verdict=verdict, probability=told.probability + told.still)
    if named is nothing:
        remarks = findings if verdict == "unchanged" and told.named > _REMARKED else ()
        findings = ()
    findings = (*_turned(pair), *findings)
    if verdict == "unchanged" and findings:
        verdict = "explained"
    sizes = _errors_beside(named)
    before, after = _chi2(errors, nothing, sizes), _chi2(errors, named, sizes)
    left = float(np.sqrt(np.mean(np.abs(named.outcome.left) ** 2)))
    change = float(np.sqrt(np.mean(np.abs(pair.change) ** 2)))
    return Comparison(
        verdict,
        told.probability,
        change,
        findings,
        limits(errors, named) if verdict in ("unchanged", "explained") else (),
        repeatability(pair),
        (),
        Remaining(left, INSTRUMENT * named.outcome.sizes.instrument),
        before,
        after,
        held_out_chi2(nothing, held, sizes),
        held_out_chi2(named, held, sizes),
        tuple((float(pair.frequency[a]), float(pair.frequency[b - 1])) for a, b in held),
        _says(replace(told, verdict=verdict), (findings, remarks), change, left),
        ComparedCurve(pair.frequency, pair.before, pair.after, named.errors.as_recorded(named.at.predicted)),
        time.monotonic() - began,
        remarks,
    )


def _usual(errors: PairErrors, fit: Fitted, k: int) -> bool:
    """Return whether a change moves no point by more than the usual difference of two recordings of one device.

    Noise is not included in that difference, since it is known and accounted for separately.
    """
    change = fit.hypothesis.changes[k]
    if isinstance(change, AmplitudeDependent) and change.known:
        return False  # levels that differ are another reason than a usual difference
    if isinstance(change, Scaled):
        sizes = fit.hypothesis.values(fit.outcome.total, k)
        return abs(sizes["shift"]) < _WARM and abs(sizes["capacitance"]) < STRENGTH * _WARM
    pair = errors.pair
    moved = np.abs(np.log(fit.at.predicted / _predicted_without(fit, k)))
    drift = _DRIFT * np.abs(fit.errors.slope)
    usual = np.sqrt((2 * INSTRUMENT) ** 2 + drift**2 + errors.of_fixture(pair.after) ** 2)
    return bool(np.mean(moved > usual) < _FEW)


def _predicted_without(fit: Fitted, k: int) -> Impedances:
    """Return the prediction without change `k`, all others as they are, ohm, shape (N,)."""
    pair, x = fit.errors.pair, np.delete(fit.x, np.r_[fit.hypothesis.slices[k]])
    return fit.hypothesis.without(k).predict(pair.before, pair.frequency, x, fit.errors.own)


def _simplest(searched: Searched, alike: Sequence[int]) -> Fitted:
    """Return the hypothesis with the fewest changes among those that the pair cannot distinguish from the best."""
    return min((searched.fits[k] for k in alike), key=lambda one: len(one.hypothesis.changes), default=searched.nothing)


def _substantial(searched: Searched, best: Fitted, errors: PairErrors) -> Fitted:
    """Return an explanation without changes that are negligible beside the others: errors of their formulas, or drift.

    The change of a model is taken to be as wrong as the model is.
    """
    changes = best.hypothesis.changes
    if len(changes) < 2:
        return best
    ratios = [np.abs(np.log(best.at.predicted / _predicted_without(best, k))) for k in range(len(changes))]
    moves = [float(np.sqrt(np.mean(ratio**2))) for ratio in ratios]
    models = [one.found.described.rms_log_error for one in changes if isinstance(one, ModelChange)]
    parts = [_FORMULA if one.where == TERMINALS else max(_INSIDE, *models, 0) for one in changes]
    least = [part * max(moves) for part in parts]
    large = [k for k, size in enumerate(moves) if size > least[k] and not _usual(errors, best, k)]
    kept = tuple(changes[k] for k in large or [int(np.argmax(moves))])
    return best if len(kept) == len(changes) else _without(errors, searched, kept)


def _probable(errors: PairErrors, searched: Searched, best: Fitted, alike: Sequence[int]) -> Fitted:
    """Return an explanation without the changes that are less likely than not."""
    changes, chances = best.hypothesis.changes, searched.probabilities()
    if len(changes) < 2 or float(sum(chances[k] for k in alike)) >= NAMED:
        return best
    kept = tuple(one for one in changes if _probability(searched, chances, one, ()) >= NAMED)
    return _without(errors, searched, kept) if kept else best


@dataclass(frozen=True)
class _Told:
    """The verdict and its probabilities."""

    verdict: Verdict
    probability: float
    still: float
    """Probability that nothing changed."""
    named: float
    """Probability of the named changes."""
    other: str = ""
    """Sentence on the most probable unnamed explanation."""


def _told(searched: Searched, best: Fitted, alike: Sequence[int], pair: Pair) -> _Told:
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
        min((_probability(searched, chances, one, ()) for one in best.hypothesis.changes), default=0.0),
    )
    other = apart + kind + nothing * (1 - usual)
    says = max((apart, NOTHING_IN_COMMON), (kind, DEVICES_OF_A_KIND), (nothing * (1 - usual), ""))[1]
    if still >= max(named, other) or (still > 1 - _SURE and named >= other):
        return _Told("unchanged", still, still, named)
    if named < NAMED:
        return _Told("unexplained", max(other, 1 - still - named), still, named, says)
    left = float(np.sqrt(np.mean(np.abs(best.outcome.left) ** 2)))
    change = float(np.sqrt(np.mean(np.abs(pair.change) ** 2)))
    whole = best.outcome.usual >= NAMED or left < _EXPLAINED * change
    return _Told("explained" if whole else "partly-explained", named, still, named)


def _class(searched: Searched, errors: PairErrors) -> list[int]:
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


def _findings(
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
    sizes = _errors_beside(named)
    for k, change in enumerate(named.hypothesis.changes):
        others = tuple(c for j, c in enumerate(named.hypothesis.changes) if j != k)
        without = _without(errors, searched, others)
        ratio = np.log(named.at.predicted / _predicted_without(named, k))
        rivals = _rivals(searched, chances, change, others, range(len(searched.fits)))
        made.append(
            ChangeFinding(
                effect=change.effect,
                where=change.where,
                step=change.found.described.step if isinstance(change, ModelChange) else "",
                probability=_probability(searched, chances, change, alike),
                bands_Hz=_bands(errors.pair, ratio),
                parameters=_sizes(whole, whole.hypothesis.changes.index(change)),
                chi2_per_dof_before=_chi2(errors, without, sizes),
                chi2_per_dof_after=_chi2(errors, named, sizes),
                held_out_before=held_out_chi2(without, held, sizes),
                held_out_after=held_out_chi2(named, held, sizes),
                alternatives=rivals,
                says=change.says + _twins(searched, change, others, alike),
                share=1 - _chi2(errors, named, sizes) / _chi2(errors, without, sizes),
                same_as=_rivals(searched, chances, change, others, alike),
                moves=float(np.sqrt(np.mean(np.abs(ratio) ** 2))),
                removed=isinstance(change, TwoPort | ModelChange) and change.taken,
            )
        )
    return tuple(made)


def _without(errors: PairErrors, searched: Searched, others: tuple[Change, ...]) -> Fitted:
    """Return the fit with all but one of the changes."""
    known = next((one for one in searched.fits if one.hypothesis.changes == others), None)
    return known or fitted(Hypothesis(others), errors, np.zeros(sum(len(one.sizes) for one in others)))


def _probability(searched: Searched, chances: Reals, change: Change, alike: Sequence[int]) -> float:
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


def _turned(pair: Pair) -> tuple[ChangeFinding, ...]:
    """Return the finding that only one of the recordings is inverted in its file."""
    if pair.turned[0] == pair.turned[1]:
        return ()
    which = "before" if pair.turned[0] else "after"
    how = pair.turned[0] or pair.turned[1]
    says = f"The recording of {which} is {how} in its file; it was put right before it was compared."
    nan = float("nan")
    whole = ((float(pair.frequency[0]), float(pair.frequency[-1])),)
    return (ChangeFinding("polarity", "terminals", "", 1.0, whole, {}, nan, nan, nan, nan, (), says, nan),)


def _chi2(errors: PairErrors, fit: Fitted, sizes: Sizes) -> float:
    """Return the misfit in units of noise and errors of these sizes, for each number."""
    return fit.errors.quadratic(fit.at, sizes) / (2 * errors.pair.frequency.size)


def _errors_beside(named: Fitted) -> Sizes:
    """Return the sizes of the errors beside an explanation, with which all others are compared to it."""
    return replace(named.outcome.sizes, rest=min(named.outcome.sizes.rest, USUAL_REST))


def _held_out(count: int) -> tuple[tuple[int, int], ...]:
    edges = np.linspace(0, count, _BLOCKS + 1).round().astype(int)
    return tuple((int(edges[k]), int(edges[k + 1])) for k in _HELD)


def held_out_chi2(fit: Fitted, held: Sequence[tuple[int, int]], sizes: Sizes) -> float:
    """Return the increase of the minimal chi2 by the held-out points, for each number (Chow's test)."""
    rest = fit.errors.without(held).quadratic(fit.at, sizes)
    count = 2 * sum(b - a for a, b in held)
    return (fit.errors.quadratic(fit.at, sizes) - rest) / count


def _bands(pair: Pair, effect: "np.ndarray[tuple[int], np.dtype[np.complex128]]") -> Bands:
    """Return at most three bands in which a change moves ln Z by more than half of its maximum."""
    size = np.abs(effect)
    pairs = sorted(true_runs(size > 0.5 * size.max()), key=lambda edge: -float(np.sum(size[edge[0] : edge[1]])))[:3]
    return tuple((float(pair.frequency[a]), float(pair.frequency[b - 1])) for a, b in pairs)


def _says(
    told: _Told, known: tuple[Sequence[ChangeFinding], Sequence[ChangeFinding]], change: float, left: float
) -> tuple[str, ...]:
    """Return the answer in sentences; `known` are the findings and the remarks."""
    size, (findings, remarks) = f"{100 * change:.2g} % of Z", known
    sure = "" if told.probability >= _SURE else f" (probability {told.probability:.2f})"
    maybe = " and ".join(f"{one.effect} (probability {one.probability:.2f})" for one in remarks)
    if told.verdict == "unchanged" and told.probability < NAMED:
        first = f"No change is sure: the recordings differ by {size}, perhaps by {maybe}."
    elif told.verdict == "unchanged":
        likely = "Nothing changed" if not sure else "Probably nothing changed"
        first = f"{likely} beyond what two recordings of one device differ by ({size}){sure}."
        first += f" Within that, {maybe} would fit." if maybe else ""
    else:
        first = {
            "explained": f"The recordings differ by {size}, and the findings explain it{sure}.",
            "partly-explained": f"The recordings differ by {size}; the findings leave {100 * left:.2g} % unexplained.",
            "unexplained": f"The recordings differ by {size}, and nothing known explains it{sure}.",
        }[told.verdict]
    return (first, *((told.other,) if told.other else ()), *(finding.says for finding in findings))
