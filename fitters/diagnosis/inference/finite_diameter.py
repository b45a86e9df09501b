"""Test for a finite diameter: compare the two-dimensional disk model with the best one-dimensional explanation.

Radial overtones and the edge mode are no small addition to the thickness mode, and no extension of the one-dimensional
model describes them to the noise. The whole disk is therefore fitted anew, with all ten constants, by `disk2d`.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import expit

from ....models.base.errors import PzctlError
from ....models.disk2d.matrices import CONSTANTS
from ....models.effects import Added, Device, find_effect, outside_effects
from ....models.effects.base.effect import TERMINALS
from ...disk.bare_disk import bare_disk
from ...disk.two_d.disk2d import FittedDisk, disk_result, fitted_disk, with_effects
from ...disk.two_d.tensor_start import implausibility
from ...engine.covariance import estimate
from ...engine.objective import Objective
from ...engine.on_cores import on_cores
from ...engine.parameters.assembly import stack_of
from ...engine.parameters.coordinates import Coordinates
from ...interface import Curve, FitError, FitResult, FitTask
from ..decision_rules import COARSENED_RIM, NAMED, ODDS
from ..findings import Finding, Size
from ..hypotheses.problem import Candidate
from ..search.refit import Refit
from ..validation.bands import guilty_bands

NAME = "lateral-modes"
_SHOWS = 0.02
"""Rms of ln(Z_model/Z) of the one-dimensional fit above which the test is run, since lateral modes are strong: the best
plate model leaves 0.27, 0.11 and 0.035 at diameter/thickness 10, 20 and 40."""
_DESCRIBED = 6e-3
"""Rms of ln(Z_model/Z) below which the two-dimensional fit is complete: the accuracy of its reduced model."""
_ROUNDS = 4
"""Budget: descents in two dimensions, of at most twelve steps each."""
_TERMINALS = 2
"""Budget: effects at the terminals beside the finite diameter."""
_STARTS = (-1.0, 1.0)
"""Start sizes of an effect, in standard deviations of ln size."""
_MORE = 14
"""Number of parameters that the disk model has beyond a plate: seven complex constants."""


@dataclass(frozen=True, eq=False)
class BesideTheRim:
    """An effect at the terminals of a finite disk."""

    candidate: Candidate
    probability: float
    sizes: Mapping[str, Size]
    chi2_without: float
    """Misfit per degree of freedom without it."""


@dataclass(frozen=True, eq=False)
class FiniteDisk:
    """Fit of the bare disk's recordings by a disk of finite diameter."""

    result: FitResult
    probability: float
    beside: tuple[BesideTheRim, ...] = ()

    @property
    def described(self) -> bool:
        """Whether the residual is within the accuracy of the two-dimensional model."""
        return self.result.rms_log_error < _DESCRIBED


def finite(
    task: FitTask, null: Refit, best: Refit, progress: Callable[[str], None], jobs: int = 1
) -> FiniteDisk | None:
    """Fit the two-dimensional disk; return it if it is more probable than the `best` one-dimensional explanation.

    Effects at the terminals are looked for on it as on a plate. Return None otherwise: also if there is no recording of
    a round bare disk, if the disk is too wide for its rim to matter, or if the best explanation leaves too little for
    lateral modes.
    """
    left = _rms(best)
    if left < _SHOWS:
        return None
    # A plate with effects at its terminals may leave less than a disk without them, until the disk has them, too.
    hopeless = math.inf if any(one.where == TERMINALS for one in best.effects) else left
    progress("fitting the disk in two dimensions")
    began = time.perf_counter()
    try:
        alone = fitted_disk(task, _ROUNDS, enough=_DESCRIBED, hopeless=hopeless, jobs=jobs)
        # An effect at the terminals hides a rim from neither model: without it, too, the disk must beat the plate.
        if disk_result(alone, 0.0).rms_log_error > _rms(null):
            return None
        whole, added = _with_terminals(alone, progress, jobs)
        result = disk_result(whole, time.perf_counter() - began)
    except FitError:
        return None
    probability = _probability(task, result, null, best)
    return FiniteDisk(result, probability, added) if probability > NAMED else None


def _rms(one: Refit) -> float:
    """Return the largest rms of ln(Z_model/Z) of a recording."""
    return max(float(np.sqrt(np.mean(np.abs(ratio) ** 2))) for ratio in one.objective.log_ratios(one.descent.x))


def _with_terminals(
    alone: FittedDisk, progress: Callable[[str], None], jobs: int
) -> tuple[FittedDisk, tuple[BesideTheRim, ...]]:
    """Return the disk with the effects at its terminals that its recordings show, largest gain first."""
    nominal = stack_of(alone.disk.build, alone.disk.build.step(alone.disk.step))
    steps = (alone.disk.step,)
    left = [
        Candidate(effect, where, steps, effect.effect_parameters(nominal, where))
        for effect in outside_effects()
        for where in effect.places(nominal)
        if effect.effect_parameters(nominal, where)
    ]
    best, taken, found = alone, list[Candidate](), list[BesideTheRim]()
    for _ in range(_TERMINALS):
        progress(f"trying {len(left)} effects beside the finite diameter")
        ends = on_cores([partial(_beside, best, taken, one, z) for one in left for z in _STARTS], jobs)
        trials: list[tuple[float, dict[str, float], Candidate]] = []
        for k, one in enumerate(left):
            own = [end for end in ends[k * len(_STARTS) : (k + 1) * len(_STARTS)] if end is not None]
            if own:
                chi2, values = min(own, key=lambda end: end[0])
                trials.append((_log_odds(best, chi2, one), values, one))
        if not trials:
            break
        trials.sort(key=lambda trial: -trial[0])
        odds, values, one = trials[0]
        others = float(np.sum(np.exp(np.array([trial[0] for trial in trials]) - odds)))
        probability = float(expit(odds)) / others
        if probability < NAMED:
            break
        made = _fitted(best, [*taken, one], values)
        found.append(BesideTheRim(one, probability, _effect_sizes(made, one), _chi2_alone(best)))
        best, left = made, [other for other in left if other is not one]
        taken.append(one)
    return best, tuple(found)


def _beside(
    best: FittedDisk, known: Sequence[Candidate], one: Candidate, z: float
) -> tuple[float, dict[str, float]] | None:
    """Return misfit and parameters of the effects when fitted with a further one, which starts `z` deviations away."""
    values, _ = best.descent.objective.coordinates.forward(best.descent.x)
    start = {name: values[name] for other in known for name in other.parameters}
    start |= {
        name: float(knob.expected[0] * np.exp(z * knob.expected[1])) if knob.from_nothing else knob.null
        for name, knob in zip(one.parameters, one.effect_parameters, strict=True)
    }
    try:
        made = _fitted(best, [*known, one], start)
    except (PzctlError, ArithmeticError, np.linalg.LinAlgError):
        return None
    values, _ = made.descent.objective.coordinates.forward(made.descent.x)
    return _chi2_alone(made), {name: values[name] for name in start}


def _fitted(best: FittedDisk, effects: Sequence[Candidate], start: Mapping[str, float]) -> FittedDisk:
    """Return the disk fitted with these effects; it may have some of them already."""
    added = [Added(one.effect, one.where, {k.name: k.null for k in one.effect_parameters}) for one in effects]
    blocks = [block for one in effects for block in one.blocks(start)]
    return with_effects(_without(best, effects[:-1]), added, blocks, start)


def _without(found: FittedDisk, effects: Sequence[Candidate]) -> FittedDisk:
    """Return the fit with the coordinates of these effects taken away; its values stay where they are."""
    if not effects:
        return found
    names = {name for one in effects for name in one.parameters}
    before = found.descent.objective
    coordinates = before.coordinates
    values, _ = coordinates.forward(found.descent.x)
    blocks = tuple(block for block in coordinates.blocks if not names & set(block.parameters))
    free = tuple(name for name in coordinates.free if name not in names)
    kept = Coordinates(blocks, {n: v for n, v in values.items() if n not in names}, free)
    bare = [
        replace(one, model=one.model.bare if isinstance(one.model, Device) else one.model) for one in before.recordings
    ]
    objective = Objective(bare, kept, before.priors)
    return replace(found, descent=replace(found.descent, objective=objective, start=kept.x, x=kept.x))


def _chi2_alone(found: FittedDisk) -> float:
    """Return mean |ln(Z_model/Z)|^2 over its expectation from noise."""
    objective = found.descent.objective
    ratios = objective.log_ratios(found.descent.x)
    squares = [
        np.abs(ratio / one.noise)[np.isfinite(one.noise)] ** 2 / 2
        for one, ratio in zip(objective.recordings, ratios, strict=True)
    ]
    return max(1.0, float(np.mean(np.concatenate(squares))))


def _log_odds(before: FittedDisk, left: float, one: Candidate) -> float:
    """Return ln odds of an effect beside the rim that leaves this misfit, by the rule of `_probability`."""
    points = sum(recording.sweep.frequency.size for recording in before.descent.objective.recordings)
    was = _chi2_alone(before)
    gain = points * float(np.log(was / left)) - len(one.parameters) / 2 * float(np.log(2 * points))
    return gain / _coarseness(points * float(np.log(left))) + float(np.log(ODDS * one.effect.odds))


def _coarseness(short: float) -> float:
    """Return how much ln evidence counts as one nat if this much is missing."""
    return 1 + COARSENED_RIM * max(0.0, short)


def _effect_sizes(found: FittedDisk, one: Candidate) -> dict[str, Size]:
    """Return an effect's parameters with standard uncertainties."""
    coordinates = found.descent.objective.coordinates
    values, _ = coordinates.forward(found.descent.x)
    covariance = estimate(found.descent).covariance
    names = coordinates.parameters
    return {
        knob.name: Size(
            values[name], float(np.sqrt(max(0.0, covariance[names.index(name), names.index(name)]))), knob.unit
        )
        for name, knob in zip(one.parameters, one.effect_parameters, strict=True)
    }


def _probability(task: FitTask, result: FitResult, null: Refit, best: Refit) -> float:
    """Return the probability of a finite diameter, treating the residual of either explanation as noise of its size.

    Ten free constants can imitate much that they do not cause, so they must be plausible for a ceramic. As for any
    effect, evidence is coarsened by the misfit of the better explanation. The prior odds are even: every disk has a
    rim, and the only question is whether the recordings show it.
    """
    plates = [_chi2_of(one, result) for one in (null, best)]
    chi2 = max(result.chi2_per_dof, 1.0)
    points = sum(curve.frequency.size for curve in result.curves)
    gain = points * float(np.log(max(min(plates), 1.0) / chi2)) - _MORE / 2 * float(np.log(2 * points))
    disk = bare_disk(task, "disk2d", round_one=True, frees=True)
    layer = disk.layer.name
    found = {name: complex(one.re, one.im) for name, one in result.constants.items()}
    against = implausibility(disk, {name: found[f"{layer}.{name}"] for name in CONSTANTS})
    log_odds = gain / _coarseness(points * float(np.log(min(chi2, *plates)))) - against
    return float(expit(log_odds)) * max(0.0, 1 - chi2 / max(plates[0], chi2))


def _chi2_of(one: Refit, result: FitResult) -> float:
    """Return mean |ln(Z_model/Z)|^2 over its expectation from noise, at the points that the result covers."""
    reached = {(curve.step, f) for curve in result.curves for f in curve.frequency.tolist()}
    squares = [
        np.abs(ratio[kept]) ** 2 / 2
        for recording, ratio in zip(one.objective.recordings, one.in_noise, strict=True)
        if (kept := np.array([(recording.step, f) in reached for f in recording.sweep.frequency.tolist()])).any()
    ]
    return float(np.mean(np.concatenate(squares)))


def findings_of(finite: FiniteDisk, null: Refit, held_before: float) -> list[Finding]:
    """Return the finite diameter as a finding, and the effects at the terminals beside it."""
    rim = finding_of(finite, null, held_before)
    return [rim, *(_finding_beside(finite, one, rim) for one in finite.beside)]


def _finding_beside(finite: FiniteDisk, one: BesideTheRim, rim: Finding) -> Finding:
    return Finding(
        effect=one.candidate.effect.name,
        where=one.candidate.where,
        step=rim.step,
        probability=one.probability,
        bands_Hz=rim.bands_Hz,
        parameters=one.sizes,
        chi2_per_dof_before=one.chi2_without,
        chi2_per_dof_after=finite.result.chi2_per_dof,
        held_out_before=float("nan"),
        held_out_after=float("nan"),
        alternatives=(),
        says=one.candidate.effect.says.format(where=one.candidate.where),
        share=max(0.0, 1 - finite.result.chi2_per_dof / max(one.chi2_without, 1e-300)),
    )


def finding_of(finite: FiniteDisk, null: Refit, held_before: float) -> Finding:
    """Return the finding, with the bands in which the one-dimensional fit fails."""
    layer = next(iter(finite.result.constants)).partition(".")[0]
    where = f"layer:{layer}"
    step = finite.result.curves[0].step
    bands = [
        band
        for recording, ratio in zip(null.objective.recordings, null.objective.log_ratios(null.descent.x), strict=True)
        if recording.step == step
        for band in guilty_bands(recording.sweep.frequency, np.abs(ratio / recording.noise) ** 2 / 2)
    ]
    return Finding(
        effect=NAME,
        where=where,
        step=step,
        probability=finite.probability,
        bands_Hz=tuple(bands[:5]),
        parameters=_sizes(finite.result, layer),
        chi2_per_dof_before=null.chi2_per_dof,
        chi2_per_dof_after=finite.result.chi2_per_dof,
        held_out_before=held_before,
        held_out_after=float("nan"),
        alternatives=(),
        says=find_effect(NAME).says.format(where=where)
        + f" Fitted in two dimensions, {finite.result.rms_log_error:.2g} is left of ln Z (root mean square).",
    )


def curves(finite: FiniteDisk, of_null: tuple[Curve, ...]) -> tuple[Curve, ...]:
    """Return one final curve per initial curve; outside the range of the two-dimensional fit it is unchanged."""
    left = list(finite.result.curves)
    made: list[Curve] = []
    for curve in of_null:
        own = next((one for one in left if one.step == curve.step and set(one.frequency) <= set(curve.frequency)), None)
        if own is None:
            made.append(curve)
            continue
        left = [one for one in left if one is not own]
        fitted = curve.fitted.copy()
        fitted[np.isin(curve.frequency, own.frequency)] = own.fitted
        made.append(replace(curve, fitted=fitted))
    return tuple(made)


def _sizes(result: FitResult, layer: str) -> dict[str, Size]:
    """Return the lateral constants, which the thickness mode does not determine."""
    found = {name: result.constants.get(f"{layer}.{name}") for name in ("c11E", "c12E", "c13E")}
    return {name: Size(one.re, one.u_re or 0.0, one.unit) for name, one in found.items() if one is not None}
