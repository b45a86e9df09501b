"""Manual fit of a bare round disk: its radial modes with the model of `radial`, or both modes with that of `disk`.

While all constants that a fitter moves together are free, the fit uses that fitter's own coordinates, which are passive
everywhere. As soon as one is held, each constant gets its own coordinate, so that a held constant keeps its value
instead of some combination with the free ones.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...models.base.arrays import Reals
from ...models.constants.piezo_constants import Radial
from ...models.disk.round_disk import BothModes, RadialDisk
from ...models.effects import Device, outside_effects
from ...models.effects.base.device import Added
from ...models.stack import Stack
from ..diagnosis.hypotheses.problem import Candidate
from ..disk.bare_disk import BareDisk, bare_disk
from ..disk.disk_coordinates import ARM_CONSTANTS, both_modes_constants
from ..disk.disk_fitter import DISK_CONSTANTS, disk_answer, disk_model, disk_split, disk_start
from ..disk.planar_result import Named, disk_priors, planar_coordinates
from ..disk.radial import RADIAL_TOGETHER, radial_answer, radial_band, radial_model, radial_start, radial_top
from ..disk.radial_coordinates import RADIAL_CONSTANTS, plate_blocks, radial_constants_block
from ..disk.radial_modes import radial_peaks
from ..engine.descent import Descent
from ..engine.multi_step_fit import check_task
from ..engine.noise import noise_of
from ..engine.parameters.assembly import stack_of
from ..engine.parameters.coordinates import Block, Coordinates, thickness_constants
from ..engine.recording import Prior, Recording
from ..interface import FitError, FitResult, FitTask
from .manual_choices import NAME, Bands, Kept

_BY = Named(NAME, "1")
_EVERYTHING: Bands = ((0.0, np.inf),)


@dataclass(frozen=True, eq=False)
class _Begun:
    """A fitter's model of a disk at its start, before any choices."""

    model: RadialDisk | BothModes
    usual: Bands
    parts: Bands
    answer: Callable[[Descent, float], FitResult]
    """Makes the result from a descent and its duration in seconds."""
    says: tuple[str, ...]


@dataclass(frozen=True)
class _Kind:
    """Differences between the fitters of a bare disk."""

    fitter: str
    constants: tuple[str, ...]
    together: tuple[str, ...]
    """Constants that move in combination while all are free."""
    passive: Callable[[str], Block]
    """Joint coordinates of all constants, by the layer's name."""
    apart: Callable[[str, Mapping[str, float]], tuple[Block, ...]]
    """Separate coordinates, by the layer's name and the start values."""
    begin: Callable[[BareDisk], _Begun]
    """Makes the start: from peaks of the recording, else from library values. Raises FitError if there are neither."""


class DiskManualFit:
    """Manual fit of the bare disk's recordings. A `Subject`."""

    def __init__(self, task: FitTask, kind: _Kind) -> None:
        """Prepare the bare disk. Raises FitError if there is none, or no start values."""
        disk = bare_disk(replace(task, free=None), kind.fitter, round_one=True, frees=True)
        sweeps = check_task(task)[1][disk.step]
        self.fitter, self.build = kind.fitter, disk.build
        self.sweeps = {disk.step: sweeps}
        self.noises = {disk.step: noise_of(sweeps)[1]}
        begun = kind.begin(disk)
        self.usual, self.parts, self.says = begun.usual, begun.parts, begun.says
        self._disk, self._kind, self._begun = disk, kind, begun
        usual = self._coordinates((kind.passive(disk.layer.name),))
        self._free, (self.values, _) = usual.free, usual.forward(usual.x)

    def pose(self, kept: Kept) -> "_DiskFitSetup":
        """Return the fit of the selected recordings."""
        recordings = tuple(
            Recording(step, sweep, self._begun.model, sigma) for step, pairs in kept.items() for sweep, sigma in pairs
        )
        stack = stack_of(self.build, self.build.step(self._disk.step))
        return _DiskFitSetup(self, recordings, disk_priors(self._disk, self._kind.constants), stack)

    def answer(self, steps: Sequence[str], descent: Descent, seconds: float) -> FitResult:
        """Return the result of a fit; `steps` can only be the bare disk's."""
        return self._begun.answer(descent, seconds)

    def blocks(self, values: Mapping[str, float], free: tuple[str, ...] | None) -> tuple[tuple[Block, ...], set[str]]:
        """Return the coordinates of a fit with these `free`, and their names; None: the usual ones."""
        at, moving = self._disk.layer.name, set(self._free if free is None else free)
        whole = self._kind.passive(at)
        blocks = (whole,) if moving.issuperset(whole.coordinates) else self._kind.apart(at, values)
        return self._coordinates(blocks).blocks, moving

    def _coordinates(self, blocks: tuple[Block, ...]) -> Coordinates:
        disk, kind = self._disk, self._kind
        blocks = (*blocks, *plate_blocks(disk.layer.name))
        return planar_coordinates(disk, kind.fitter, blocks, self._begun.model, kind.constants, kind.together, None)


@dataclass(frozen=True, eq=False)
class _DiskFitSetup:
    subject: DiskManualFit
    recordings: tuple[Recording, ...]
    priors: tuple[Prior, ...]
    stack: Stack

    def places(self, names: Iterable[str] | None = None) -> tuple[Candidate, ...]:
        wanted = None if names is None else set(names)
        steps = tuple(dict.fromkeys(recording.step for recording in self.recordings))
        return tuple(
            Candidate(effect, where, steps, effect.effect_parameters(self.stack, where))
            for effect in outside_effects()
            if wanted is None or effect.name in wanted
            for where in effect.places(self.stack)
        )

    def with_effects(self, effects: Sequence[Candidate]) -> tuple[Recording, ...]:
        if not effects:
            return self.recordings
        added = tuple(
            Added(candidate.effect, candidate.where, {knob.name: knob.null for knob in candidate.effect_parameters})
            for candidate in effects
        )
        model = Device(self.recordings[0].model, added, nominal=self.stack)
        return tuple(replace(recording, model=model) for recording in self.recordings)

    def coordinates(
        self, effects: Sequence[Candidate], values: Mapping[str, float], free: tuple[str, ...] | None
    ) -> Coordinates:
        blocks, moving = self.subject.blocks(values, free)
        if free is None:
            moving |= {name for candidate in effects for name in candidate.parameters}
        return Coordinates(
            (*blocks, *(b for candidate in effects for b in candidate.blocks(values))), values, tuple(moving)
        )


def radial_in_hand(task: FitTask) -> DiskManualFit:
    """Return a manual fit of a bare disk's radial modes. Raises FitError."""
    return DiskManualFit(task, _RADIAL)


def disk_in_hand(task: FitTask) -> DiskManualFit:
    """Return a manual fit of a bare disk's radial and thickness modes. Raises FitError."""
    return DiskManualFit(task, _DISK)


def _radial_begun(disk: BareDisk) -> _Begun:
    says: tuple[str, ...] = ()
    try:
        peaks = radial_peaks(disk)
        first, constants = peaks.frequencies[0], radial_start(radial_band(disk, peaks), peaks)
    except FitError as error:
        first, constants, says = disk.expected_radial_mode, _of_library(disk), _begins(error)
        if constants is None:
            raise
    model = radial_model(disk, constants, first)
    usual = ((0.0, radial_top(disk, first)),)
    return _Begun(model, usual, _EVERYTHING, lambda descent, s: radial_answer(_BY, disk, descent, first, s), says)


def _disk_begun(disk: BareDisk) -> _Begun:
    says: tuple[str, ...] = ()
    try:
        model, references = disk_start(disk)
    except FitError as error:
        references = disk.expected_radial_mode, disk.expected_thickness_mode
        constants, says = _of_library(disk), _begins(error)
        if constants is None:
            raise
        model = disk_model(disk, constants, {}, references)
    split = disk_split(disk)
    parts = ((0.0, split), (float(np.nextafter(split, np.inf)), np.inf))
    of = model, references
    return _Begun(model, _EVERYTHING, parts, lambda descent, s: disk_answer(_BY, disk, descent, of, s), says)


def _begins(error: FitError) -> tuple[str, ...]:
    return (f"It starts from the library's values, because the recording gives no start: {error}.",)


def _of_library(disk: BareDisk) -> Radial | None:
    """Return the radial constants of build and library; None if any is missing."""
    known = [disk.layer.values.get(name) for name in RADIAL_CONSTANTS]
    values = [quantity.value for quantity in known if quantity is not None]
    return Radial(*values) if len(values) == len(known) else None


def _alone(name: str, values: Mapping[str, float]) -> Block:
    """Return the block of an independent lossy constant: logarithm of its real part, with fixed sign, and its loss."""
    sign = np.sign(values[f"{name}.re"])

    def forward(x: Reals) -> tuple[Reals, Reals]:
        re, loss = sign * np.exp(x[0]), x[1]
        return np.array([re, -re * loss]), np.array([[re, 0.0], [-re * loss, -re]])

    def inverse(p: Reals) -> Reals:
        return np.array([np.log(np.abs(p[0])), -p[1] / p[0]])

    return Block((name, f"{name}.loss"), (f"{name}.re", f"{name}.im"), forward, inverse)


def _radial_apart(at: str, values: Mapping[str, float]) -> tuple[Block, ...]:
    return tuple(_alone(f"{at}.{name}", values) for name in RADIAL_CONSTANTS)


def _disk_apart(at: str, values: Mapping[str, float]) -> tuple[Block, ...]:
    return (thickness_constants(at), *(_alone(f"{at}.{name}", values) for name in ARM_CONSTANTS))


_RADIAL = _Kind("radial", RADIAL_CONSTANTS, RADIAL_TOGETHER, radial_constants_block, _radial_apart, _radial_begun)
_DISK = _Kind("disk", DISK_CONSTANTS, ARM_CONSTANTS, both_modes_constants, _disk_apart, _disk_begun)
