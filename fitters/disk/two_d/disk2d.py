"""Fitter `disk2d`: all ten complex constants of a round disk from its own recording, in two dimensions.

Radial overtones and the edge mode, which overlap the thickness resonance of a real disk, are part of the model
(`models/disk2d`), so the constants need not compensate for them. Losses are causal, constants passive by construction.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np

from ....models.base.arrays import Frequencies
from ....models.constants.passivity import passivity_margin
from ....models.constants.tensor import Tensor6mm
from ....models.disk2d.disk_model import Disk2D
from ....models.disk2d.full import FullDisk
from ....models.disk2d.matrices import CONSTANTS
from ....models.disk2d.reduced import ReducedDisk
from ....models.disk2d.training import HIGHEST, LARGEST, SMALLEST, ensured
from ....models.effects import Added, Device
from ....models.stack import CausalConstantQ
from ...engine.covariance import estimate
from ...engine.descent import Descent, descend
from ...engine.fitted_model import FittedModel
from ...engine.objective import Objective
from ...engine.parameters.assembly import stack_of
from ...engine.parameters.coordinates import Block, Coordinates, positive
from ...engine.recording import Posterior, Prior, Recording
from ...interface import FitError, FitResult, FitTask, TaskError
from ..bare_disk import BareDisk, bare_disk
from ..planar_result import PLANAR_UNITS, Named, planar_answer, radial_named
from .determined_constants import undetermined
from .misfit_as_noise import at_level, judged, left_of
from .predictions import predictions, sentence
from .reduced_disk_cache import reduced_disk
from .tensor_coordinates import COORDINATES, tensor_block
from .tensor_start import starts, tensor_priors, unusual
from .valley_search import searched

Known: TypeAlias = Prior | Posterior
_TOLERANCE = 1e-5
_ROUNDS, _STILL, _MOST = 12, 0.01, 12
# Finally the remaining misfit is counted as noise and the descent repeated, until it falls by less than 1 %.
_TOGETHER = 6
# Budget of descents with effects at the terminals, from a disk that is fitted already.
_CHECKED = 12
# Number of frequencies at which the reduced model is checked against the full equations.
_SHORTEST = 0.5
# Smallest radius of the electrodes over that of the disk.
_PREDICTED = 0.87
# Part of the model's highest frequency up to which modes are predicted: 1.3 times the thickness resonance.


class Disk2DFitter:
    """All ten complex constants of a free round disk, in two dimensions."""

    name = "disk2d"
    version = "3"
    summary = "all ten complex constants of a round disk in two dimensions: radial, edge and thickness modes together"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the ten constants to all recordings of the bare disk.

        Raises FitError if none of the recordings is of a round bare disk of diameter/thickness 2 to 60 below 1.5 times
        its thickness resonance.
        """
        return finite_disk(task, progress=progress)

    def fitted_model(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FittedModel:
        """Return the fitted disk, for a diagnosis. Raises FitError as `fit` does."""
        found = fitted_disk(task, progress=progress)
        return FittedModel(
            found.descent, stack_of(found.disk.build, found.disk.build.step(found.disk.step)), PLANAR_UNITS
        )


def finite_disk(
    task: FitTask,
    rounds: int = _ROUNDS,
    progress: Callable[[str], None] = lambda _: None,
    enough: float = 0.0,
) -> FitResult:
    """Fit the disk of finite diameter to the recordings of the bare disk, to see how well it describes them.

    `chi2_per_dof` refers to the same noise of every point as in the one-dimensional fitters, but only to points up to
    1.5 times the thickness resonance; `curves` contains them, with the model's impedance. The material need not be
    known more closely than as a piezoceramic. `rounds`: number of descents of at most twelve steps after the search; if
    the last one has not converged, the result has `converged=False`. `enough`: rms of ln Z below which a valley is
    accepted without searching for others. Raises the same FitError as the fitter.
    """
    began = time.perf_counter()
    found = fitted_disk(task, rounds, progress, enough)
    return disk_result(found, time.perf_counter() - began)


@dataclass(frozen=True, eq=False)
class FittedDisk:
    """A disk of finite diameter, fitted to the recordings of the bare disk."""

    disk: BareDisk
    model: Disk2D
    descent: Descent
    error: float
    """Estimated error of the reduced model, relative to the capacitance."""
    electrode: float
    """Radius of the electrodes over that of the disk."""


def fitted_disk(
    task: FitTask,
    rounds: int = _ROUNDS,
    progress: Callable[[str], None] = lambda _: None,
    enough: float = 0.0,
    hopeless: float = math.inf,
    jobs: int = 1,
) -> FittedDisk:
    """Fit the disk; parameters and errors raised as for `finite_disk`.

    `hopeless`: rms of ln Z that a description must not exceed; if the most promising places lead to no such one,
    FitError is raised. `jobs`: number of processes.
    """
    disk = bare_disk(task, Disk2DFitter.name, round_one=True, frees=True)
    electrode, disk = _electrode(disk), _within_reach(disk)
    full, reduced = reduced_disk(_ratio(disk), progress, electrode)
    progress(f"fitting {disk.step}")
    model = _model(disk, reduced)
    descent, error = _descend(disk, full, model, task.free, rounds, (enough, hopeless), jobs)
    return FittedDisk(disk, model, descent, error, electrode)


def with_effects(
    found: FittedDisk, added: Sequence[Added], blocks: Sequence[Block], start: Mapping[str, float]
) -> FittedDisk:
    """Return the disk fitted together with effects at its terminals, starting from a fit without them.

    `blocks` are the coordinates of the effects' parameters, `start` their values.
    """
    disk, before = found.disk, found.descent.objective
    values, _ = before.coordinates.forward(found.descent.x)
    nominal = stack_of(disk.build, disk.build.step(disk.step))
    own = [one.moved(start) for one in added]
    names = tuple(name for block in blocks for name in block.coordinates)
    coordinates = Coordinates(
        (*before.coordinates.blocks, *blocks), {**values, **start}, (*before.coordinates.free, *names)
    )
    x, evaluations, last, settled = coordinates.x, found.descent.evaluations, math.inf, False
    model = Device(before.recordings[0].model, tuple(own), nominal=nominal)
    recordings = [
        Recording(disk.step, sweep, model, noise) for sweep, noise in zip(disk.sweeps, disk.noises, strict=True)
    ]
    for _ in range(_TOGETHER):
        recordings = [at_level(each, coordinates, x) for each in recordings]
        step = descend(Objective(recordings, coordinates, before.priors), x, _TOLERANCE, _MOST)
        evaluations, x = evaluations + step.evaluations, step.x
        left = left_of(recordings, coordinates, x)
        settled = left > (1 - _STILL) * last
        last = left
        if settled:
            break
    return replace(found, descent=judged(recordings, coordinates, before.priors, x, settled, evaluations))


def disk_result(found: FittedDisk, seconds: float) -> FitResult:
    """Return the result of a fit that took this long."""
    disk, descent = found.disk, found.descent
    layer = disk.layer.name

    def make(values: Mapping[str, float]) -> dict[str, complex]:
        return _named(layer, _tensor_of(values, layer))

    tensor = _tensor_of(descent.objective.coordinates.forward(descent.x)[0], layer)
    says = (
        *([f"Electrodes end at {found.electrode:.4g} of the disk's radius."] if found.electrode < 1 else []),
        f"Constants at {_reference(disk) / 1e3:.5g} kHz, with causal losses. The reduced model is accurate to "
        f"{found.error:.1g} of the capacitance (estimated from its residual in the full equations).",
        f"Passivity check passed: the smallest loss tangent is {passivity_margin(tensor.law):.2g} (Holland).",
        *undetermined(descent, layer),
        *unusual(disk.layer, tensor),
    )
    named = Named(Disk2DFitter.name, Disk2DFitter.version)
    answer = planar_answer(named, disk, descent, make, says, seconds)
    return _predicting(answer, disk, found.model, descent)


def _predicting(answer: FitResult, disk: BareDisk, model: Disk2D, descent: Descent) -> FitResult:
    """Return the result with predictions outside the recorded bands."""
    coordinates = descent.objective.coordinates
    values, _ = coordinates.forward(descent.x)
    fitted = model.replace({name: values[name] for name in model.parameters()})
    high = _PREDICTED * HIGHEST / disk.sizes["thickness"].re
    covariance = estimate(descent).covariance
    predicted = predictions(fitted, coordinates.parameters, covariance, disk.expected_radial_mode / 2, high)
    bands = [(float(sweep.frequency[0]), float(sweep.frequency[-1])) for sweep in disk.sweeps]
    text = sentence(predicted, disk.layer.name, bands)
    return replace(answer, derived={**answer.derived, **predicted}, says=(*answer.says, text))


def _ratio(disk: BareDisk) -> float:
    return 2 * disk.radius / disk.sizes["thickness"].re


def _electrode(disk: BareDisk) -> float:
    """Return the radius of the electrodes over that of the disk, 1 by default. Raises FitError."""
    given = disk.layer.values.get("electrode_diameter")
    if given is None:
        return 1.0
    part = given.re / (2 * disk.radius)
    if not _SHORTEST <= part <= 1:
        raise FitError(
            f"electrode_diameter_mm of {disk.layer.name!r} is {1e3 * given.re:.4g}; `disk2d` covers "
            f"{2e3 * _SHORTEST * disk.radius:.4g} to {2e3 * disk.radius:.4g}, the disk's diameter"
        )
    if given.u > 0:
        raise FitError(
            f"electrode_diameter_mm of {disk.layer.name!r} has an uncertainty; `disk2d` takes it as exact: fit once "
            "for each value that it may have"
        )
    return part


def _within_reach(disk: BareDisk) -> BareDisk:
    """Return the recordings up to the model's highest frequency. Raises FitError."""
    ratio = _ratio(disk)
    if not SMALLEST <= ratio <= LARGEST:
        raise FitError(f"`disk2d` covers diameter/thickness {SMALLEST:g} to {LARGEST:g}; this disk has {ratio:.3g}")
    highest = HIGHEST / disk.sizes["thickness"].re
    kept = disk.between(0.0, highest)
    if not kept.sweeps:
        raise FitError(
            f"`disk2d` reaches up to {highest / 1e3:.4g} kHz for this thickness; the recordings are of {disk.bands}"
        )
    return kept


def _reference(disk: BareDisk) -> float:
    """Return the reference frequency of the constants in Hz: the geometric mean of the band of all recordings."""
    low = min(float(sweep.frequency[0]) for sweep in disk.sweeps)
    return math.sqrt(low * max(float(sweep.frequency[-1]) for sweep in disk.sweeps))


def _tensor_of(values: Mapping[str, float], layer: str) -> Tensor6mm:
    return Tensor6mm(*(complex(values[f"{layer}.{c}.re"], values[f"{layer}.{c}.im"]) for c in CONSTANTS))


def _named(layer: str, tensor: Tensor6mm) -> dict[str, complex]:
    """Return the ten constants and all derived ones by full name, SI."""
    plate = tensor.thickness
    named = {name: complex(getattr(tensor, name)) for name in CONSTANTS}
    named |= {"c33D": plate.c33D, "h33": plate.h33, "kt": plate.kt}
    return {f"{layer}.{name}": value for name, value in named.items()} | radial_named(layer, tensor.radial)


def _parts(disk: BareDisk, model: Disk2D, free: tuple[str, ...] | None) -> tuple[Coordinates, list[Recording]]:
    """Return the coordinates and the recordings of a fit. Raises FitError for a name that cannot be freed."""
    at = disk.layer.name
    sizes = [disk.size_name(name) for name in disk.sizes]
    uncertain = {disk.size_name(name) for name, q in disk.sizes.items() if q.u > 0}
    whole = {f"{at}.{name}" for name in CONSTANTS}
    moving = whole | uncertain if free is None else set(free)
    if not moving <= whole | set(sizes):
        unknown = min(moving - whole - set(sizes))
        raise TaskError(f"cannot free {unknown!r}: `disk2d` has {', '.join(sorted(whole | set(sizes)))}")
    if not whole <= moving:
        left = min(whole - moving)
        raise TaskError(f"`disk2d` frees all ten constants together; {left!r} is not among those to free")
    blocks = (tensor_block(at), *(positive(name) for name in sizes))
    names = (*(f"{at}.{name}" for name in COORDINATES), *moving)
    recordings = [
        Recording(disk.step, sweep, model, noise) for sweep, noise in zip(disk.sweeps, disk.noises, strict=True)
    ]
    return Coordinates(blocks, model.parameters(), names), recordings


def _descend(
    disk: BareDisk,
    full: FullDisk,
    model: Disk2D,
    free: tuple[str, ...] | None,
    rounds: int,
    limits: tuple[float, float],
    jobs: int,
) -> tuple[Descent, float]:
    """Return the deepest minimum, and the estimated error of the reduced model there; `limits`: enough and hopeless."""
    coordinates, recordings = _parts(disk, model, free)
    priors = tensor_priors(disk)
    x, evaluations = searched(disk, model, recordings, coordinates, priors, *limits, jobs)
    error, before, settled = math.inf, math.inf, False
    for _ in range(rounds):
        model, error = _checked(disk, full, model.replace(coordinates.forward(x)[0]))
        recordings = [at_level(replace(each, model=model), coordinates, x) for each in recordings]
        last = descend(Objective(recordings, coordinates, priors), x, _TOLERANCE, _MOST)
        evaluations, x = evaluations + last.evaluations, last.x
        left = left_of(recordings, coordinates, x)
        settled = last.converged or (recordings[0].misfit > 0 and left > (1 - _STILL) * before)
        before = left
        if settled:
            break
    return judged(recordings, coordinates, priors, x, settled, evaluations), error


def _checked(disk: BareDisk, full: FullDisk, model: Disk2D) -> tuple[Disk2D, float]:
    """Return the model on a reduced disk that is accurate for its constants, and the estimated error of that."""
    ends = [(float(sweep.frequency[0]), float(sweep.frequency[-1])) for sweep in disk.sweeps]
    f: Frequencies = np.concatenate([np.linspace(low, high, _CHECKED) for low, high in ends])
    reduced, error = ensured(full, model.reduced, model.shape, model.over(f), f)
    return (model if reduced is model.reduced else replace(model, reduced=reduced)), error


def _model(disk: BareDisk, reduced: ReducedDisk) -> Disk2D:
    """Return the causal disk with constants of the library and the sizes of the build."""
    layer, sizes = disk.layer.name, {name: q.re for name, q in disk.sizes.items()}
    tensor = _tensor_of(starts(disk)[0], layer)
    law = CausalConstantQ(_reference(disk))
    return Disk2D(layer, tensor, sizes["area"], sizes["thickness"], sizes["density"], reduced, law)
