"""Test for a finite diameter: compare the two-dimensional disk model with the best one-dimensional explanation.

Radial overtones and the edge mode are no small addition to the thickness mode, and no extension of the one-dimensional
model describes them to the noise. The whole disk is therefore fitted anew, with all ten constants, by `disk2d`.
"""

import time
from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np
from scipy.special import expit

from ....models.base.errors import PzctlError
from ....models.disk2d.disk_model import Disk2D
from ....models.disk2d.matrices import CONSTANTS
from ....models.effects import Added, find_effect, outside_effects
from ....models.effects.base.effect import TERMINALS
from ....models.stack import CONSTANT, CausalConstantQ, LossLaw, Stack
from ...disk.bare_disk import bare_disk
from ...disk.two_d.disk2d import disk_result
from ...disk.two_d.disk_fit import NAME as NAME_2D
from ...disk.two_d.disk_fit import FittedDisk, fitted_disk, reference_of
from ...disk.two_d.disk_under_diagnosis import diagnosable, plate_of, thinner, with_effects
from ...disk.two_d.outside import Outside
from ...disk.two_d.tensor_start import implausibility
from ...engine.fitted_model import FittedModel, Seed, without_effects
from ...engine.objective import Objective
from ...engine.on_cores import on_cores
from ...engine.parameters.assembly import stack_of
from ...engine.parameters.coordinates import Block, positive
from ...engine.recording import Posterior, Recording
from ...interface import Constant, Curve, FitError, FitResult, FitTask
from ..decision_rules import COARSENED_RIM, NAMED, ODDS
from ..findings import Finding, FitSummary, Size
from ..hypotheses.problem import Candidate
from ..search.refit import Refit
from ..validation.bands import guilty_bands

NAME = "lateral-modes"
_SHOWS = 0.02
"""Rms of ln(Z_model/Z) of the one-dimensional fit above which the test is run, since lateral modes are strong: the best
plate model leaves 0.27, 0.11 and 0.035 at diameter/thickness 10, 20 and 40."""
_DESCRIBED = 6e-3
"""Rms of ln(Z_model/Z) below which the two-dimensional fit is complete: the accuracy of its reduced model."""
_NEAR = 0.03
"""Rms of ln(Z_model/Z) of a quick fit from which the disk's constants are near enough for effects to be added."""
_WIRES = (
    ("lead-inductance", TERMINALS, ("inductance", "resistance")),
    ("stray-capacitance", TERMINALS, ("capacitance",)),
)
"""Effects at the terminals, with their parameters, that are fitted together with a disk that does not fit alone."""
_ROUNDS = 4
"""Budget: descents in two dimensions, of at most twelve steps each."""
_TERMINALS = 2
"""Budget: effects at the terminals beside the finite diameter."""
_STARTS = (-1.0, 1.0)
_NEAR_STARTS = (0.0,)
"""Start sizes of an effect, in standard deviations of ln size; the latter from constants that fit with wires."""
_RIM, _FALL, _EARLY = 7.0, -1.4, 0.3
"""Rms of ln Z that the best plate leaves of a disk, as a power of diameter/thickness (see `_SHOWS`), and the part of it
from which the disk is tried before all else."""
_TRIED = 1.5
"""chi2 up to which a disk counts as described, so that nothing beside it is looked for here."""
_FALLS = 0.7
"""Part of chi2 that an effect may leave to be one from which the search begins, which then says whether it is there."""
_MORE = 14
"""Number of parameters that the disk model has beyond a plate: seven complex constants."""


@dataclass(frozen=True, eq=False)
class DiskTried:
    """A disk of finite diameter as fitted to the bare disk's recordings, alone and with effects at its terminals."""

    alone: FittedDisk
    whole: FittedDisk
    beside: tuple[Candidate, ...]
    """Effects at the terminals of the whole."""
    result: FitResult
    """Of the whole."""

    @property
    def described(self) -> bool:
        """Whether the residual is within the accuracy of the two-dimensional model."""
        return self.result.rms_log_error < _DESCRIBED

    @property
    def model(self) -> FittedModel:
        """The disk without effects, with the law of losses that fits with them; a search begins with them."""
        bare, objective = self.alone.descent, self.alone.descent.objective
        recordings = [_lossy(one, self.whole.model.law) for one in objective.recordings]
        same = Objective(recordings, objective.coordinates, objective.priors)
        made = diagnosable(replace(self.alone, model=self.whole.model, descent=replace(bare, objective=same)))
        names = frozenset((one.effect.name, one.where) for one in self.beside)
        values, _ = self.whole.descent.objective.coordinates.forward(self.whole.descent.x)
        return replace(made, seeds=(Seed(names, values),) if names else ())


def _lossy(recording: Recording, law: LossLaw) -> Recording:
    model = recording.model
    return replace(recording, model=replace(model, law=law)) if isinstance(model, Disk2D) else recording


@dataclass(frozen=True, eq=False)
class FiniteDisk:
    """A finite diameter that is more probable than what a plate can have."""

    tried: DiskTried
    probability: float

    @property
    def result(self) -> FitResult:
        """The fit in two dimensions."""
        return self.tried.result


def shows_early(task: FitTask, null: Refit) -> bool:
    """Return whether the plate leaves as much as a rim would, so that the disk is fitted before anything else."""
    try:
        disk = bare_disk(task, "disk2d", round_one=True, frees=True)
    except FitError:
        return False
    ratio = 2 * disk.radius / disk.sizes["thickness"].re
    return _rms(null) > max(_SHOWS, _EARLY * _RIM * ratio**_FALL)


def tried(
    task: FitTask, null: Refit, best: Refit | None, progress: Callable[[str], None], jobs: int = 1
) -> DiskTried | None:
    """Fit the two-dimensional disk, and look for effects at its terminals.

    Return None if there is no recording of a round bare disk, if the disk is too wide for its rim to matter, or if the
    `best` explanation by a plate (the one without effects, if there is no other yet) leaves too little.
    """
    left = _rms(best or null)
    if left < _SHOWS:
        return None
    # A plate with effects at its terminals may leave less than a disk without them, until the disk has them, too.
    hopeless = _rms(null) if best is None or any(one.where == TERMINALS for one in best.effects) else left
    progress("fitting the disk in two dimensions")
    began = time.perf_counter()
    try:
        alone, base = _disks(task, hopeless, progress, jobs)
        whole, added = _with_terminals(alone, base, progress, jobs)
        return DiskTried(alone, whole, added, disk_result(whole, time.perf_counter() - began))
    except FitError:
        return None


def _disks(task: FitTask, hopeless: float, progress: Callable[[str], None], jobs: int) -> tuple[FittedDisk, FittedDisk]:
    """Return the disk fitted alone, and one whose constants are good starts for a fit with effects at the terminals.

    With an effect the disk alone may end anywhere, so that no effect added there helps; it is then also searched for
    with a lead and a stray capacitance, which act as most effects at the terminals do. Raises FitError if neither
    leaves less than `hopeless`.
    """
    alone = _attempt(task, _NEAR, jobs, None)
    if alone is not None and left_by(alone) < _DESCRIBED:
        return alone, alone
    progress("fitting the disk in two dimensions together with its wires")
    disk = bare_disk(task, NAME_2D, round_one=True, frees=True)
    joint = _attempt(task, _NEAR, jobs, _wires(stack_of(disk.build, disk.build.step(disk.step))))
    if joint is not None:
        base = _without(joint, [name for name, _, _ in _WIRES])
        return alone or with_effects(base, Outside()), base
    alone = alone or fitted_disk(task, _ROUNDS, enough=_DESCRIBED, hopeless=hopeless, jobs=jobs)
    # An effect at the terminals hides a rim from neither model: without it, too, the disk must beat the plate.
    if left_by(alone) > hopeless:
        raise FitError(f"a disk of finite diameter leaves {left_by(alone):.2g} of ln Z, more than {hopeless:.2g}")
    return alone, alone


def _attempt(task: FitTask, enough: float, jobs: int, outside: Outside | None) -> FittedDisk | None:
    """Return a quick fit; None if it leaves more of ln Z (rms) than is `enough`."""
    try:
        return fitted_disk(task, _ROUNDS, enough=enough, hopeless=enough, jobs=jobs, outside=outside)
    except FitError:
        return None


def _wires(nominal: Stack) -> Outside:
    """Return a lead and a stray capacitance of usual sizes."""
    added: list[Added] = []
    blocks: list[Block] = []
    start: dict[str, float] = {}
    priors: list[Posterior] = []
    for effect, where, free in _WIRES:
        found = find_effect(effect)
        knobs = found.effect_parameters(nominal, where)
        one = Candidate(found, where, (), tuple(knob for knob in knobs if knob.name in free))
        added.append(Added(found, where, {knob.name: knob.null for knob in knobs}))
        for name, knob in zip(one.parameters, one.effect_parameters, strict=True):
            median, spread = knob.expected
            blocks.append(positive(name))
            start[name] = median * float(np.exp(-spread))
            priors.append(Posterior((name,), np.array([np.log(median)]), np.array([[1 / spread]])))
    return Outside(tuple(added), tuple(blocks), start, tuple(priors), nominal)


def finite(made: DiskTried, task: FitTask, null: Refit, best: Refit) -> FiniteDisk | None:
    """Return the disk if it is more probable than the `best` one-dimensional explanation."""
    probability = _probability(task, made.result, null, best)
    return FiniteDisk(made, probability) if probability > NAMED else None


def _rms(one: Refit) -> float:
    """Return the largest rms of ln(Z_model/Z) of a recording."""
    return max(float(np.sqrt(np.mean(np.abs(ratio) ** 2))) for ratio in one.objective.log_ratios(one.descent.x))


def left_by(found: FittedDisk) -> float:
    """Return the largest rms of ln(Z_model/Z) of a recording."""
    ratios = found.descent.objective.log_ratios(found.descent.x)
    return max(float(np.sqrt(np.mean(np.abs(ratio) ** 2))) for ratio in ratios)


def _with_terminals(
    alone: FittedDisk, base: FittedDisk, progress: Callable[[str], None], jobs: int
) -> tuple[FittedDisk, tuple[Candidate, ...]]:
    """Return the disk with effects at its terminals, largest gain first, from which a search can begin.

    A search that starts from the disk alone does not find them: its constants have gone far to imitate them. Trials
    start from the constants of `base`.
    """
    nominal = plate_of(alone)
    steps = (alone.disk.step,)
    left = [
        Candidate(effect, where, steps, effect.effect_parameters(nominal, where))
        for effect in outside_effects()
        for where in effect.places(nominal)
        if effect.effect_parameters(nominal, where)
    ]
    few, taken, values = thinner(base), list[Candidate](), dict[str, float]()
    before = _chi2_alone(thinner(alone))
    starts = _STARTS if base is alone else _NEAR_STARTS
    while len(taken) < _TERMINALS and before > _TRIED:
        progress(f"trying {len(left)} effects beside the finite diameter")
        ends = on_cores([partial(_beside, few, taken, one, z) for one in left for z in starts], jobs)
        pairs = zip(ends, (one for one in left for _ in starts), strict=True)
        points = sum(one.sweep.frequency.size for one in few.descent.objective.recordings)
        trials = [(_log_odds(points * np.log(before / end[0]), points, one), end, one) for end, one in pairs if end]
        if not trials:
            break
        odds, (chi2, there), one = max(trials, key=lambda trial: trial[0])
        if odds < 0 or chi2 > _FALLS * before:
            break
        few, values, before = _fitted(few, [*taken, one], there), there, chi2
        left = [other for other in left if other is not one]
        taken.append(one)
    return (_lawful(base, taken, values) if taken else alone), tuple(taken)


def _lawful(base: FittedDisk, effects: Sequence[Candidate], start: Mapping[str, float]) -> FittedDisk:
    """Return the disk fitted with these effects to all points, by the law of losses that describes them better."""
    made = _fitted(base, effects, start)
    if _chi2_alone(made) < _TRIED:
        return made
    law = CONSTANT if made.model.law != CONSTANT else CausalConstantQ(reference_of(base.disk))
    other = _fitted(base, effects, start, law)
    return min((made, other), key=_chi2_alone)


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


def _fitted(
    best: FittedDisk, effects: Sequence[Candidate], start: Mapping[str, float], law: LossLaw | None = None
) -> FittedDisk:
    """Return the disk fitted with these effects; it may have some of them already."""
    added = tuple(Added(one.effect, one.where, {k.name: k.null for k in one.effect_parameters}) for one in effects)
    blocks = tuple(block for one in effects for block in one.blocks(start))
    outside = Outside(added, blocks, start, nominal=plate_of(best))
    return with_effects(_without(best, [one.effect.name for one in effects]), outside, law)


def _without(found: FittedDisk, effects: Collection[str]) -> FittedDisk:
    return replace(found, descent=without_effects(found.descent, effects))


def _chi2_alone(found: FittedDisk) -> float:
    """Return mean |ln(Z_model/Z)|^2 over its expectation from noise."""
    objective = found.descent.objective
    ratios = objective.log_ratios(found.descent.x)
    squares = [
        np.abs(ratio / one.noise)[np.isfinite(one.noise)] ** 2 / 2
        for one, ratio in zip(objective.recordings, ratios, strict=True)
    ]
    return max(1.0, float(np.mean(np.concatenate(squares))))


def _log_odds(gain: float, points: int, one: Candidate) -> float:
    """Return ln odds of an effect beside the rim, given the gain in ln likelihood with all misfit as noise."""
    return gain - len(one.parameters) / 2 * float(np.log(2 * points)) + float(np.log(ODDS * one.effect.odds))


def _coarseness(short: float) -> float:
    """Return how much ln evidence counts as one nat if this much is missing."""
    return 1 + COARSENED_RIM * max(0.0, short)


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


def finding_of(finite: FiniteDisk, null: Refit, held_before: float, final: FitSummary) -> Finding:
    """Return the finding, with the bands in which the one-dimensional fit fails; `final`: the disk as diagnosed."""
    layer = finite.tried.alone.disk.layer.name
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
        parameters=_sizes(final.constants, layer),
        chi2_per_dof_before=null.chi2_per_dof,
        chi2_per_dof_after=final.chi2_per_dof,
        held_out_before=held_before,
        held_out_after=final.held_out,
        alternatives=(),
        says=find_effect(NAME).says.format(where=where)
        + f" Fitted in two dimensions, {finite.result.rms_log_error:.2g} is left of ln Z (root mean square).",
    )


def curves(of_disk: Sequence[Curve], of_null: Sequence[Curve]) -> tuple[Curve, ...]:
    """Return one final curve per initial curve; outside the range of the two-dimensional fit it is unchanged."""
    left = list(of_disk)
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


def _sizes(constants: Mapping[str, Constant], layer: str) -> dict[str, Size]:
    """Return the lateral constants, which the thickness mode does not determine."""
    found = {name: constants.get(f"{layer}.{name}") for name in ("c11E", "c12E", "c13E")}
    return {name: Size(one.re, one.u_re or 0.0, one.unit) for name, one in found.items() if one is not None}
