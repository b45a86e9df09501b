"""A disk of finite diameter with effects at its terminals or another law of losses: where a search can begin."""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ....models.base.arrays import Reals
from ....models.base.face_loads import FACES
from ....models.disk2d.disk_model import Disk2D
from ....models.effects import Added, EffectParameter, find_effect, outside_effects
from ....models.effects.base.effect import TERMINALS
from ....models.stack import CONSTANT, CausalConstantQ, Stack
from ...disk.bare_disk import BareDisk, bare_disk
from ...disk.two_d.disk_fit import NAME, FittedDisk, fitted_disk
from ...disk.two_d.disk_under_diagnosis import plate_of, thinner, with_effects
from ...disk.two_d.outside import Outside
from ...disk.two_d.reference import reference_of
from ...engine.fitted_model import without_effects
from ...engine.on_cores import on_cores
from ...engine.parameters.assembly import stack_of
from ...engine.parameters.coordinates import Block, positive
from ...engine.recording import Posterior, log_ratio
from ...interface import UNCOMPUTABLE, FitError, FitTask
from ..decision_rules import ODDS
from ..hypotheses.problem import Candidate

DESCRIBED = 6e-3
"""Rms of ln(Z_model/Z) below which the two-dimensional fit is complete: the accuracy of its reduced model."""
NEAR = 0.03
"""Rms of ln(Z_model/Z) of a quick fit from which the disk's constants are near enough for effects to be added."""
_FIRST = 0.3
"""Part of what a plate leaves of ln Z (rms) that the quick fit of a wide disk with a rim leaves at most: 0.26 of 24
disks of D/t 22 to 50, most of them below 0.2 (tests/benchmarks/test_wide_disks.py)."""
_TOGETHER = (
    ("lead-inductance", TERMINALS, ("inductance", "resistance")),
    ("stray-capacitance", TERMINALS, ("capacitance",)),
    ("electrode-mass", FACES[1], ("mass",)),
)
"""Effects with their parameters that are fitted together with a disk that does not fit alone: wires and electrodes."""
_INSIDE = ("loss-dispersion", "electrode-mass", "surface-layer")
"""Effects on the disk and in it that are tried together with those at the terminals, because each absorbs part of the
other: a loss that changes over the band looks like a resistance or a cable. Every disk has electrodes and ground faces.
"""
_ROUNDS = 4
"""Budget: descents in two dimensions, of at most twelve steps each."""
_BESIDE = 3
"""Budget: effects beside the finite diameter: two at the terminals and a law of losses."""
_STARTS = (-1.0, 1.0)
_NEAR_STARTS = (0.0,)
"""Start sizes of an effect, in standard deviations of ln size; the latter from constants that fit with wires. A size of
either sign always starts on both sides of zero."""
_PROMISING, _STRETCH = 4, 2.5
"""Budget: effects fitted beside the finite diameter at a time. Largest factor by which a change is scaled linearly."""
_NARROW = 20.0
"""Diameter/thickness up to which a rim leaves a tenth of ln Z or more."""
_DEVIATIONS = 5.0
"""Standard deviations of chi2 up to which a disk counts as described, so that nothing beside it is looked for here."""
_FOUND = 100.0
"""chi2 up to which the constants of the disk are taken for the right ones."""
_ERRING = 1e-3
"""Rms of ln Z up to which a disk counts as described whatever the noise: an analyzer in its specification leaves it."""
_FALLS = 0.7
"""Part of chi2 that an effect may leave to be one from which the search begins, which then says whether it is there."""


def ratio_of(disk: BareDisk) -> float:
    """Return diameter over thickness."""
    return 2 * disk.radius / disk.sizes["thickness"].re


def is_narrow(disk: BareDisk) -> bool:
    """Return whether a rim leaves more of ln Z than nearly any effect does, so that a plate need not be tried first."""
    return ratio_of(disk) <= _NARROW


@dataclass(frozen=True, eq=False)
class DiskBeside:
    """A disk fitted alone, and with effects beside its finite diameter."""

    alone: FittedDisk
    whole: FittedDisk
    beside: tuple[Candidate, ...] = ()
    """Effects of the whole."""


def alone_with_wires(task: FitTask, hopeless: float, progress: Callable[[str], None], jobs: int) -> DiskBeside | None:
    """Return the disk fitted alone, and with the effects at its terminals and in its laws that it seems to have.

    None if it leaves more than `hopeless` or NEAR of ln Z (rms) alone: with an effect it may end anywhere.
    """
    alone = _attempt(task, min(NEAR, hopeless), jobs, None)
    return None if alone is None else with_terminals(alone, alone, progress, jobs)


def together_with_wires(
    task: FitTask, alone: FittedDisk | None, progress: Callable[[str], None], jobs: int
) -> DiskBeside | None:
    """Return the same as searched for with a lead, a stray capacitance and electrodes from the beginning.

    A lead and a capacitance act as most effects at the terminals do; the right one is then looked for from the disk's
    constants beside them. `alone`: the disk without effects, if it is known. None if more than NEAR is left.
    """
    progress("fitting the disk in two dimensions together with its wires")
    disk = bare_disk(task, NAME, round_one=True, frees=True)
    joint = _attempt(task, NEAR, jobs, partial(_together, stack_of(disk.build, disk.build.step(disk.step))))
    if joint is None:
        return None
    base = _without(joint, [name for name, _, _ in _TOGETHER])
    found, _ = joint.descent.objective.coordinates.forward(joint.descent.x)
    return with_terminals(alone or with_effects(base, Outside()), base, progress, jobs, found)


def wide_disk_with_wires(
    task: FitTask, hopeless: float, progress: Callable[[str], None], jobs: int, of_plate: float
) -> DiskBeside:
    """Return the same for a disk whose overtones are too many for wires to be searched for at once.

    Raises FitError if the quick fit leaves more than is `hopeless`, or takes away too little of what a plate without
    effects leaves, `of_plate`: with a wrong order of its overtones, too, it takes away most of a rim.
    """
    promising = min(hopeless, max(NEAR, _FIRST * of_plate))
    alone = fitted_disk(task, _ROUNDS, enough=promising, hopeless=promising, jobs=jobs)
    near = with_terminals(alone, alone, progress, jobs)
    return near if is_described(near) else better([near, of_random_ceramics(task, hopeless, progress, jobs)])


def of_random_ceramics(task: FitTask, hopeless: float, progress: Callable[[str], None], jobs: int) -> DiskBeside:
    """Return the disk as found from random ceramics, with what is beside it. Raises FitError if it leaves too much."""
    alone = fitted_disk(task, _ROUNDS, hopeless=hopeless, jobs=jobs)
    # An effect at the terminals hides a rim from neither model: without it, too, the disk must beat the plate.
    if left_by(alone) > hopeless:
        raise FitError(f"a disk of finite diameter leaves {left_by(alone):.2g} of ln Z, more than {hopeless:.2g}")
    return with_terminals(alone, alone, progress, jobs)


def is_described(found: DiskBeside) -> bool:
    """Return whether the fit needs no other start."""
    left = left_by(found.whole)
    return left < _ERRING or (left < DESCRIBED and chi2_alone(found.whole) < _FOUND)


def better(found: Sequence[DiskBeside]) -> DiskBeside:
    """Return the one that leaves least."""
    return min(found, key=lambda one: chi2_alone(one.whole))


def _attempt(task: FitTask, enough: float, jobs: int, outside: Callable[[Disk2D], Outside] | None) -> FittedDisk | None:
    """Return a quick fit; None if it leaves more of ln Z (rms) than is `enough`."""
    try:
        return fitted_disk(task, _ROUNDS, enough=enough, hopeless=enough, jobs=jobs, outside=outside)
    except FitError:
        return None


def _together(nominal: Stack, model: Disk2D) -> Outside:
    """Return a lead, a stray capacitance and electrodes of usual sizes."""
    added: list[Added] = []
    blocks: list[Block] = []
    start: dict[str, float] = {}
    priors: list[Posterior] = []
    for effect, where, free in _TOGETHER:
        found = find_effect(effect)
        knobs = found.parameters_in(model, nominal, where)
        one = Candidate(found, where, (), tuple(knob for knob in knobs if knob.name in free))
        added.append(Added(found, where, {knob.name: knob.null for knob in knobs}))
        for name, knob in zip(one.parameters, one.effect_parameters, strict=True):
            median, spread = knob.expected
            blocks.append(positive(name))
            start[name] = median * float(np.exp(-spread))
            priors.append(Posterior((name,), np.array([np.log(median)]), np.array([[1 / spread]])))
    return Outside(tuple(added), tuple(blocks), start, tuple(priors), nominal)


def left_by(found: FittedDisk) -> float:
    """Return the largest rms of ln(Z_model/Z) of a recording."""
    ratios = found.descent.objective.log_ratios(found.descent.x)
    return max(float(np.sqrt(np.mean(np.abs(ratio) ** 2))) for ratio in ratios)


def with_terminals(
    alone: FittedDisk,
    base: FittedDisk,
    progress: Callable[[str], None],
    jobs: int,
    sizes: Mapping[str, float] | None = None,
) -> DiskBeside:
    """Return the disk with effects at its terminals and in its laws of losses, from which a search can begin.

    The effect of largest gain comes first. A search that starts from the disk alone does not find them: its constants
    have gone far to imitate them. Trials start from the constants of `base`, and with what `sizes` has of an effect.
    """
    few, taken, values = thinner(base), tuple[Candidate, ...](), dict[str, float]()
    before, starts = chi2_alone(thinner(alone)), _STARTS if base is alone else _NEAR_STARTS
    while len(taken) < _BESIDE and before > _of_noise(few.descent.objective.points):
        left = [one for one in _choices(few) if (one.effect, one.where) not in [(o.effect, o.where) for o in taken]]
        progress(f"trying {len(left)} effects beside the finite diameter")
        trials = [(one, z) for one in left for z in _sides(one, starts)]
        found = _best_beside(few, taken, trials, before, jobs, sizes or {})
        if found is None:
            break
        one, values = found
        first, taken = not taken, (*taken, one)
        few = _fitted(few, taken, values)
        if first:  # what an effect that was missing did to the losses is no sign of their law
            few, taken = _instead(*_lawful(few, taken, values), jobs)
            values = _sizes_of(few, taken)
        before = chi2_alone(few)
    return DiskBeside(alone, *_lawful(_whole(few, base), taken, values)) if taken else DiskBeside(alone, alone)


def _instead(few: FittedDisk, taken: tuple[Candidate, ...], jobs: int) -> tuple[FittedDisk, tuple[Candidate, ...]]:
    """Return the disk with another effect in place of its only one, if it is better, else the same.

    A look-alike, as a cable is of a lead, takes the constants to where the right one can be fitted.
    """
    before = chi2_alone(few)
    if before < _of_noise(few.descent.objective.points):
        return few, taken
    without = _without(few, [one.effect.name for one in taken])
    others = [one for one in _choices(few) if (one.effect, one.where) not in [(o.effect, o.where) for o in taken]]
    found = _best_beside(without, (), [(one, z) for one in others for z in _sides(one, _STARTS)], before, jobs, {})
    return (few, taken) if found is None else (_fitted(without, found[:1], found[1]), found[:1])


def _whole(few: FittedDisk, base: FittedDisk) -> FittedDisk:
    """Return a fit to a few points as the start of one to all points, which `base` has."""
    own, every = few.descent.objective, base.descent.objective.recordings
    recordings = [replace(one, model=thin.model) for one, thin in zip(every, own.recordings, strict=True)]
    return replace(few, descent=replace(few.descent, objective=own.with_recordings(recordings)))


def _choices(found: FittedDisk) -> list[Candidate]:
    """Return what may be beside the finite diameter: at the terminals, electrodes, and another law of losses."""
    nominal, model = plate_of(found), found.model
    return [
        Candidate(effect, where, (found.disk.step,), knobs)
        for effect in (*outside_effects(), *map(find_effect, _INSIDE))
        for where in effect.looked_for_in(model, nominal)
        if (knobs := effect.parameters_in(model, nominal, where))
    ]


def _best_beside(
    few: FittedDisk,
    taken: Sequence[Candidate],
    starts: Sequence[tuple[Candidate, float]],
    before: float,
    jobs: int,
    sizes: Mapping[str, float],
) -> tuple[Candidate, dict[str, float]] | None:
    """Return the most probable of further effects, with the parameters of all; None if none explains enough.

    `starts`: effects with the deviations at which their sizes start, if not at `sizes`; `before`: chi2 without any.
    """
    points = few.descent.objective.points
    chosen = _promising(few, taken, [_Start.of(few, taken, one, z, sizes) for one, z in starts])
    ends = on_cores([partial(_beside, few, taken, start) for start in chosen], jobs)
    trials = [
        (_log_odds(points * np.log(before / end[0]), points, start.new), end, start.new)
        for end, start in zip(ends, chosen, strict=True)
        if end
    ]
    if not trials:
        return None
    odds, (chi2, values), one = max(trials, key=lambda trial: trial[0])
    return None if odds < 0 or chi2 > _FALLS * before else (one, values)


def _sizes_of(found: FittedDisk, effects: Sequence[Candidate]) -> dict[str, float]:
    """Return the parameters of effects that were fitted together with a disk."""
    values, _ = found.descent.objective.coordinates.forward(found.descent.x)
    return {name: values[name] for one in effects for name in one.parameters}


def _lawful(
    base: FittedDisk, effects: Sequence[Candidate], start: Mapping[str, float]
) -> tuple[FittedDisk, tuple[Candidate, ...]]:
    """Return the disk fitted with these effects to all points, by the law of losses that describes them better.

    The effects are returned as those of that law: one that bends it has a causal companion of its own only if the law
    has none.
    """
    made = _fitted(base, effects, start)
    if chi2_alone(made) < _of_noise(made.descent.objective.points):
        return made, tuple(effects)
    values, _ = made.descent.objective.coordinates.forward(made.descent.x)
    reference = reference_of(base.disk.sweeps, values, base.model.name)
    law = CONSTANT if made.model.law != CONSTANT else CausalConstantQ(reference)
    other = replace(base, model=replace(base.model, law=law))
    nominal = plate_of(other)
    again = tuple(
        replace(one, effect_parameters=one.effect.effect_parameters(nominal, one.where)) if one.effect.of_laws else one
        for one in effects
    )
    knobs = [(name, knob) for one in again for name, knob in zip(one.parameters, one.effect_parameters, strict=True)]
    try:
        fitted = _fitted(other, again, {name: start.get(name, knob.expected[0]) for name, knob in knobs})
    except UNCOMPUTABLE:
        return made, tuple(effects)
    return min((made, tuple(effects)), (fitted, again), key=lambda one: chi2_alone(one[0]))


@dataclass(frozen=True, eq=False)
class _Start:
    """Start of a fit with a further effect."""

    new: Candidate
    values: Mapping[str, float]
    """Parameters of all effects."""

    @classmethod
    def of(
        cls, best: FittedDisk, known: Sequence[Candidate], new: Candidate, z: float, found: Mapping[str, float]
    ) -> "_Start":
        """Return the start with what is found, else with sizes `z` standard deviations of ln size off the medians."""
        values, _ = best.descent.objective.coordinates.forward(best.descent.x)
        start = {name: values[name] for other in known for name in other.parameters}
        sizes = dict(new.sizes)
        start |= {
            name: _start_at(knob, z) if knob.from_nothing or name in sizes else knob.null
            for name, knob in zip(new.parameters, new.effect_parameters, strict=True)
        }
        return cls(new, start | {name: found[name] for name in new.parameters if name in found})


def _sides(one: Candidate, starts: Sequence[float]) -> Sequence[float]:
    """Return the deviations at which the sizes of an effect start."""
    return starts if all(knob.from_nothing for _, knob in one.sizes) else _STARTS


def _start_at(knob: EffectParameter, z: float) -> float:
    """Return the value of a size that many standard deviations from what is expected."""
    usual, spread = knob.expected
    return float(usual * np.exp(z * spread)) if knob.from_nothing else float(usual + z * spread)


def _promising(best: FittedDisk, known: Sequence[Candidate], starts: Sequence[_Start]) -> list[_Start]:
    """Return the starts whose effects would take away most of the misfit beside small shifts of the constants."""
    objective, x = best.descent.objective, best.descent.x
    curves = objective.curves(x)
    orthonormal, _ = np.linalg.qr(objective.jacobian(x)[: 2 * objective.points])
    residual = _beyond(orthonormal, objective.residual(x)[: 2 * objective.points])
    values, _ = objective.coordinates.forward(x)
    own = {name: value for name, value in values.items() if name in best.model.parameters()}

    def promise(start: _Start) -> float:
        outside = outside_of(best, [*known, start.new], start.values)
        device = outside.around(best.model.replace(own), start.values)
        seen = [device.impedance(one.sweep.frequency) for one in objective.recordings]
        ratios = [
            log_ratio(with_one, Z) / one.sigma
            for with_one, Z, one in zip(seen, curves, objective.recordings, strict=True)
        ]
        change = _beyond(orthonormal, np.concatenate([part for own in ratios for part in (own.real, own.imag)]))
        length, along = float(change @ change), -float(change @ residual)
        size = min(max(along / length, 0.0), _STRETCH) if length > 0 else 0.0
        return size * along - size**2 * length / 2

    return sorted(starts, key=promise, reverse=True)[:_PROMISING]


def _beyond(orthonormal: Reals, change: Reals) -> Reals:
    """Return what these columns cannot do of a change."""
    return change - orthonormal @ (orthonormal.T @ change)


def _beside(best: FittedDisk, known: Sequence[Candidate], start: _Start) -> tuple[float, dict[str, float]] | None:
    """Return misfit and parameters of the effects when fitted with a further one."""
    try:
        made = _fitted(best, [*known, start.new], start.values)
    except UNCOMPUTABLE:
        return None
    return chi2_alone(made), _sizes_of(made, [*known, start.new])


def _fitted(best: FittedDisk, effects: Sequence[Candidate], start: Mapping[str, float]) -> FittedDisk:
    """Return the disk fitted with these effects; it may have some of them already."""
    return with_effects(_without(best, [one.effect.name for one in effects]), outside_of(best, effects, start))


def outside_of(best: FittedDisk, effects: Sequence[Candidate], start: Mapping[str, float]) -> Outside:
    """Return effects beside a disk, with all their parameters free from `start`."""
    added = tuple(Added(one.effect, one.where, {k.name: k.null for k in one.effect_parameters}) for one in effects)
    blocks = tuple(block for one in effects for block in one.blocks(start))
    return Outside(added, blocks, start, nominal=plate_of(best))


def _without(found: FittedDisk, effects: Collection[str]) -> FittedDisk:
    return replace(found, descent=without_effects(found.descent, effects))


def chi2_alone(found: FittedDisk) -> float:
    """Return mean |ln(Z_model/Z)|^2 over its expectation from noise."""
    objective = found.descent.objective
    ratios = objective.log_ratios(found.descent.x)
    squares = [
        np.abs(ratio / one.noise)[np.isfinite(one.noise)] ** 2 / 2
        for one, ratio in zip(objective.recordings, ratios, strict=True)
    ]
    return max(1.0, float(np.mean(np.concatenate(squares))))


def _of_noise(points: int) -> float:
    """Return the chi2 that noise alone hardly exceeds, for so many complex points."""
    return 1 + _DEVIATIONS / float(np.sqrt(points))


def _log_odds(gain: float, points: int, one: Candidate) -> float:
    """Return ln odds of an effect beside the rim, given the gain in ln likelihood with all misfit as noise."""
    return gain - len(one.parameters) / 2 * float(np.log(2 * points)) + float(np.log(ODDS * one.effect.odds))
