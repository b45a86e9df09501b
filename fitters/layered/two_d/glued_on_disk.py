"""Glued steps in two dimensions on a disk that is known from its own recordings."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self

from ....models.base.arrays import Reals
from ....models.base.face_loads import OpenBond
from ....models.base.model import Model
from ....models.build import EffectSpec
from ....models.effects import Device, Effect, EffectParameter, catalogue
from ....models.stack import CausalConstantQ
from ....models.stack.loss_laws import CONSTANT, LossLaw, StackError
from ....models.stack2d.stack_model import Stack2D, full_section
from ....models.sweep import Sweep
from ...disk.two_d.misfit_as_noise import left_of
from ...disk.two_d.reference import reference_of, tensor_of
from ...engine.descent import descend
from ...engine.fitted_model import Seed
from ...engine.objective import Objective
from ...engine.parameters.assembly import nominal_parameters
from ...engine.parameters.coordinates import Coordinates, between
from ...engine.recording import Posterior, Recording
from ...interface import FitTask
from .stack_problem import StackProblem, nominal, plate_of, problem_of
from .stack_start import one_dimensional
from .stack_under_diagnosis import StackUnderDiagnosis, described, under_diagnosis
from .stepwise import NEAR, FittedStack, fitted_glue

_POINTS = 80
"""Points of each sweep: a stack with an open bond takes three times as long as one without."""
_LESS = 0.5
"""Part of what a bonded stack leaves of ln Z that an open one leaves at most to be what is there."""
_LEVELS, _TOLERANCE, _MOST = (0.3, 0.1, 0.02, 0.004, 0.0), 1e-4, 20
"""Successive misfits of ln Z that count as noise while an opening is fitted, tolerance and steps of each descent."""


@dataclass(frozen=True)
class KnownDisk:
    """What its own recordings told of a disk."""

    values: Mapping[str, float]
    """Every parameter."""
    law: LossLaw
    told: Posterior
    """Of the coordinates of its constants and sizes."""
    effects: tuple[EffectSpec, ...]
    """What acts at its terminals and in its laws, with the sizes found."""


def glued_on(disk: KnownDisk, task: FitTask, progress: Callable[[str], None]) -> StackUnderDiagnosis | None:
    """Return the fit of all glued steps on a disk that is known; None if there are none within reach.

    Where layers that are bonded everywhere leave much, a search begins with bonds that are open in the middle, too.
    Raises FitError.
    """
    problem = problem_of(task)
    glued = _thinned(problem, [step for step in problem.sweeps if step != problem.bare])
    if not glued.sweeps:
        return None
    plate = one_dimensional(problem, progress)
    glued = replace(glued, build=replace(problem.build, effects=disk.effects), told=disk.told)
    values = {**nominal(glued, tensor_of(disk.values, problem.disk.name)), **plate, **disk.values}
    fits: list[StackUnderDiagnosis] = []
    for law in _laws(disk, glued):
        near = fitted_glue(replace(glued, elastic_law=law), values, disk.law, progress, NEAR)
        fits.append(_as_model(near))
        if described(near):
            return fits[-1]
    progress("trying bonds that are open in the middle")
    bonded, other = sorted(fits, key=_left)
    bonds = _open_bonds(bonded)
    best = min(bonds, key=lambda bond: bond.left, default=None)
    if best is None or best.left > _LESS * _left(bonded):
        whole = fitted_glue(replace(glued, elastic_law=bonded.problem.elastic_law), values, disk.law, progress)
        return _as_model(whole)
    again = _open_bonds(other, bonds)
    if min(bond.left for bond in again) < best.left:
        bonded, bonds = other, again
    return replace(bonded, seeds=tuple(bond.seed for bond in bonds))


def _laws(disk: KnownDisk, glued: StackProblem) -> tuple[LossLaw, LossLaw]:
    """Return the laws that the layers glued on may have, that of the disk first."""
    if isinstance(disk.law, CausalConstantQ):
        return disk.law, CONSTANT
    return disk.law, CausalConstantQ(reference_of(glued.every_sweep, disk.values, glued.disk.name))


def _thinned(problem: StackProblem, steps: Sequence[str]) -> StackProblem:
    """Return the problem of these steps, with some points of each sweep."""
    sweeps, noises = dict[str, tuple[Sweep, ...]](), dict[str, tuple[Reals, ...]]()
    for step in steps:
        own = problem.sweeps[step]
        every = [slice(None, None, max(1, one.frequency.size // _POINTS)) for one in own]
        sweeps[step] = tuple(one.at(at) for one, at in zip(own, every, strict=True))
        noises[step] = tuple(one[at] for one, at in zip(problem.noises[step], every, strict=True))
    return replace(problem, sweeps=sweeps, noises=noises)


def _as_model(found: FittedStack) -> StackUnderDiagnosis:
    """Return a stack for a diagnosis, over all functions of z: those that it needs are others if a bond is open."""
    fitted = under_diagnosis(found, (), _POINTS)

    def full(one: Recording) -> Recording:
        def whole(model: Model) -> Model:
            if isinstance(model, Device):
                return replace(model, bare=whole(model.bare))
            if not isinstance(model, Stack2D):
                return model
            return replace(model, section=full_section(model.layers, float(one.sweep.frequency[-1])))

        return replace(one, model=whole(one.model))

    before = fitted.descent.objective
    objective = before.with_recordings([full(one) for one in before.recordings])
    return replace(fitted, descent=replace(fitted.descent, objective=objective))


def _left(fitted: StackUnderDiagnosis) -> float:
    objective = fitted.descent.objective
    return left_of(objective.recordings, objective.coordinates, fitted.descent.x)


@dataclass(frozen=True, eq=False)
class _FittedBond:
    """The stack fitted with one bond open."""

    effect: Effect
    where: str
    left: float
    """Norm of what is left of ln Z."""
    values: Mapping[str, float]

    @property
    def seed(self) -> Seed:
        """Where a search for effects begins."""
        return Seed(frozenset([(self.effect.name, self.where)]), self.values)


def _open_bonds(whole: StackUnderDiagnosis, before: Sequence[_FittedBond] = ()) -> list[_FittedBond]:
    """Return the stack with each bond open in turn, from the best of several sizes, or from where it was `before`."""
    begun = {(bond.effect.name, bond.where): [bond.values] for bond in before}
    made, known = list[_FittedBond](), list[tuple[_OpenBond, float, Mapping[str, float]]]()
    for effect in (one for one in catalogue() if one.lies_on_faces is OpenBond):
        for where in effect.places(whole.scale):
            own = _OpenBond.at(whole, effect, where)
            same = next((one for one in known if one[0].apart == own.apart), None)
            if same is None:  # else both faces of a layer of glue are open alike
                sizes = [{**_as_stated(whole), own.name: value} for value in own.size.scan]
                same = (own, *own.fitted(whole, begun.get((effect.name, where), sizes)))
                known.append(same)
            there, left, values = same
            made.append(_FittedBond(effect, where, left, {**values, own.name: values[there.name]}))
    return made


@dataclass(frozen=True, eq=False)
class _OpenBond:
    """The recordings of a stack with an open bond in it."""

    name: str
    """Of the parameter that is its size."""
    size: EffectParameter
    recordings: tuple[Recording, ...]

    @classmethod
    def at(cls, whole: StackUnderDiagnosis, effect: Effect, where: str) -> Self:
        """Return the recordings with this bond open in all steps that have it."""
        made: list[Recording] = []
        size: EffectParameter | None = None
        for one in whole.descent.objective.recordings:
            device = one.model if isinstance(one.model, Device) else Device(one.model, nominal=whole.scale)
            if where in effect.looked_for_in(device.bare, plate_of(whole.problem, one.step)):
                size = effect.parameters_in(device.bare, whole.scale, where)[0]
                device = device.with_effect(effect, where)
            made.append(replace(one, model=device))
        if size is None:
            raise StackError(f"stack: no step has {where}")
        return cls(f"{effect.key}@{where}.{size.name}", size, tuple(made))

    @property
    def apart(self) -> tuple[int, int] | None:
        """The layers that face each other in the opening."""
        devices = (one.model for one in self.recordings if isinstance(one.model, Device))
        with_it = next(device for device in devices if self.name in device.parameters())
        opened = with_it.replace({self.name: self.size.scan[0]}).assembly.whole
        return opened.opening.apart if isinstance(opened, Stack2D) and opened.opening is not None else None

    def fitted(
        self, whole: StackUnderDiagnosis, starts: Sequence[Mapping[str, float]]
    ) -> tuple[float, Mapping[str, float]]:
        """Return what is left with the bond open, and every parameter.

        All starts are followed for a few steps, the best of these to its end.
        """
        before = whole.descent.objective
        blocks = (*before.coordinates.blocks, between(self.name, self.size.lower, self.size.upper))
        free = (*before.coordinates.free, self.name)
        each = [Coordinates(blocks, {**before.coordinates.start, **start}, free) for start in starts]
        first, *closer = _LEVELS
        coordinates, ends = each[0], [_descended(self.recordings, before, one, one.x, first) for one in each]
        x = min(ends, key=lambda x: left_of(self.recordings, coordinates, x))
        for misfit in closer:
            x = _descended(self.recordings, before, coordinates, x, misfit)
        return left_of(self.recordings, coordinates, x), coordinates.forward(x)[0]


def _descended(
    recordings: Sequence[Recording], before: Objective, coordinates: Coordinates, x: Reals, misfit: float
) -> Reals:
    """Return the minimum if so much misfit of ln Z counts as noise."""
    softly = [replace(one, misfit=misfit, correlation=1.0) for one in recordings]
    return descend(Objective(softly, coordinates, before.all_priors), x, _TOLERANCE, _MOST).x


def _as_stated(whole: StackUnderDiagnosis) -> dict[str, float]:
    """Return every parameter, those of glued layers as the build states them: without an opening they went astray."""
    values, build = whole.descent.objective.coordinates.start, whole.problem.build
    glued = {layer.name for layer in build.layers} - {whole.problem.disk.name}
    stated = nominal_parameters(build)
    return {**values, **{name: stated[name] for name in stated if name.partition(".")[0] in glued and name in values}}
