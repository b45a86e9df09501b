"""`compare`: what changed between two recordings of a device."""

import time
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ...models.base.plain_numbers import without_exponent
from ...models.build import Build
from ...models.sweep import Sweep
from ..diagnosis.decision_rules import NAMED
from ..diagnosis.findings import Bands, Remaining
from ..diagnosis.validation.bands import guilty_bands
from ..interface import TaskError
from .answer.change_findings import findings_of, turned_in_file
from .answer.limits import limits, repeatability
from .answer.shifts import resonance_shifts
from .answer.verdict import (
    SURE,
    Told,
    alike_with_best,
    decided,
    is_usual,
    probable,
    simplest,
    substantial,
    usual_difference,
)
from .comparison import ChangeFinding, ComparedCurve, Comparison, DescribedBy
from .errors.instrument_errors import INSTRUMENT
from .errors.pair_errors import PairErrors
from .hypotheses.fitted import Fitted
from .hypotheses.misfit import chi2, errors_beside, held_out, held_out_chi2
from .hypotheses.search import Searched, search
from .known_changes.device_changes import device_changes
from .known_changes.two_ports import two_ports
from .levels.drive_levels import driven
from .pair import Pair, pair_of, righted
from .resonances import Resonances, fitted_poles, resonances_of
from .with_build.build_changes import model_changes, step_before
from .with_build.found_device import FoundDevice
from .with_build.model_change import ModelChange
from .with_build.recorded_step import refuse_absent, step_doubt

_REMARKED = 0.1
"""Smallest probability at which an uncertain explanation is mentioned."""


def compare(before: Sequence[Sweep], after: Sequence[Sweep], build: Build | None = None, step: str = "") -> Comparison:
    """Return what changed; several sweeps on a side are repeats. Raises TaskError if they cannot be compared.

    `build`: the device of which a `step` was recorded, so that changes inside can be named and sized. Raises FitError
    if it cannot be fitted.
    """
    began = time.monotonic()
    pair = pair_of(before, after)
    if np.array_equal(pair.before, pair.after):
        raise TaskError("before and after hold the same numbers, noise included: one recording is given twice")
    poles = fitted_poles(pair.frequency, pair.before, pair.noise_before)
    own = resonances_of(poles, pair.frequency, pair.before)
    after_poles = fitted_poles(pair.frequency, pair.after, pair.noise_after, poles)
    now = resonances_of(after_poles, pair.frequency, pair.after)
    levels = driven(pair, own, now)
    own = own if levels is None else levels.resonances
    errors = PairErrors(pair, (own, now))
    inside, described, doubt = ((), None, ()) if build is None else _inside(build, step, pair, own, (before, after))
    searched = search(
        errors, (*two_ports(), *device_changes(pair, own), *([] if levels is None else [levels]), *inside), after_poles
    )
    found = concluded(errors, searched, began)
    says = (found.says[0], *doubt, *found.says[1:])
    return replace(found, says=says, resonances=resonance_shifts(pair, poles, after_poles), described_by=described)


def _inside(
    build: Build, step: str, pair: Pair, own: Resonances, sides: tuple[Sequence[Sweep], Sequence[Sweep]]
) -> tuple[tuple[ModelChange, ...], DescribedBy, tuple[str, ...]]:
    """Return the changes that the device of a build can have, how the build describes it, and doubts about the step."""
    right = [[righted(one, turned) for one in side] for side, turned in zip(sides, pair.turned, strict=True)]
    first = FoundDevice.of(build, step, right[0], pair.before, own)
    earlier = step_before(build, step)
    refuse_absent(build, first, earlier)
    bare = None if earlier is None else FoundDevice.of(build, earlier, right[0], pair.before, own)
    second = FoundDevice.of(build, step, right[1], pair.after, own)
    stripped = None if earlier is None else FoundDevice.of(build, earlier, right[1], pair.after, own)
    return model_changes(build, (first, second), stripped, pair.levels), first.described, step_doubt(first, bare)


def concluded(errors: PairErrors, searched: Searched, began: float) -> Comparison:
    """Return the answer."""
    pair, nothing = errors.pair, searched.nothing
    alike = alike_with_best(searched, errors)
    whole = simplest(searched, alike)
    best = probable(errors, searched, substantial(searched, whole, errors), alike)
    told = decided(searched, best, alike, pair)
    verdict, named = told.verdict, nothing if told.verdict in ("unchanged", "unexplained") else best
    held = held_out(pair.frequency.size)
    findings = findings_of(errors, searched, (best, whole), (alike, held)) if best.hypothesis.changes else ()
    remarks: tuple[ChangeFinding, ...] = ()
    if verdict == "explained" and all(is_usual(errors, named, k) for k in range(len(named.hypothesis.changes))):
        verdict, named = "unchanged", nothing
        told = replace(told, verdict=verdict, probability=told.probability + told.still)
    if named is nothing:
        remarks = findings if verdict == "unchanged" and told.named > _REMARKED else ()
        findings = ()
    findings = (*turned_in_file(pair), *findings)
    if verdict == "unchanged" and findings:
        verdict = "explained"
    sizes = errors_beside(named)
    before, after = chi2(errors, nothing, sizes), chi2(errors, named, sizes)
    left = named.unexplained
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
        () if verdict in ("unchanged", "explained") else _leftover(errors, named),
        remarks,
    )


def _leftover(errors: PairErrors, fit: Fitted) -> Bands:
    """Return the bands in which an explanation leaves more than noise and the usual difference."""
    pair = errors.pair
    left = np.abs(np.log(pair.after / fit.errors.as_recorded(fit.at.predicted))) ** 2
    noise = 2 * (pair.noise_before**2 + pair.noise_after**2)
    return guilty_bands(pair.frequency, left / (noise + usual_difference(errors, fit) ** 2))


def _says(
    told: Told, known: tuple[Sequence[ChangeFinding], Sequence[ChangeFinding]], change: float, left: float
) -> tuple[str, ...]:
    """Return the answer in sentences; `known` are the findings and the remarks."""
    size, (findings, remarks) = f"{without_exponent(100 * change, 2)} % of Z", known
    sure = "" if told.probability >= SURE else f" (probability {told.probability:.2f})"
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
