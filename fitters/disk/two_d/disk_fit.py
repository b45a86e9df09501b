"""The fit of a disk of finite diameter to the recordings of a bare disk, alone or with effects beside it."""

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cache, partial
from typing import TypeAlias

import numpy as np

from ....models.base.arrays import Frequencies, Reals
from ....models.constants.tensor import Tensor6mm
from ....models.disk2d.disk_model import Disk2D
from ....models.disk2d.full import FullDisk
from ....models.disk2d.matrices import CONSTANTS
from ....models.disk2d.reduced import ReducedDisk
from ....models.disk2d.training import HIGHEST, LARGEST, SMALLEST, ensured
from ....models.stack import CONSTANT, CausalConstantQ, LossLaw
from ...engine.descent import Descent, descend
from ...engine.objective import Objective
from ...engine.parameters.coordinates import Coordinates, positive
from ...engine.recording import Posterior, Prior, Recording
from ...interface import FitError, FitTask, TaskError
from ..bare_disk import BareDisk, bare_disk
from ..planar_result import radial_named
from .broadened import Broadening
from .lateral_search import Effort
from .lateral_search import searched as lateral
from .misfit_as_noise import at_level, judged, left_of
from .outside import Outside
from .reduced_disk_cache import loadable_disk, odd_disk, reduced_disk
from .reference import at_resonance, reference_of, tensor_of
from .tensor_coordinates import COORDINATES, tensor_block
from .tensor_start import drawn_starts, matched, starts, tensor_priors
from .valley_search import DAMPING, searched, smoothest, thinned

Known: TypeAlias = Prior | Posterior
NAME = "disk2d"
_TOLERANCE = 1e-5
ROUNDS, _STILL, _MOST = 12, 0.01, 12
# Finally the remaining misfit is counted as noise and the descent repeated, until it falls by less than 1 %.
_NOISE = 1.1
# Misfit over that expected of the noise up to which losses count as causal without another law being tried.
_FOUND = 10.0
# Misfit over that expected of the noise up to which a place from the library counts as the right one.
_ALONE, _WITH_WIRES = Effort(2, 200), Effort(4, 200)
_SCALED, _SEARCHED = 3, 150
# Random starts: rounds and draws; tensors of the library that give the axial constants; points of each sweep.
_CHECKED = 12
# Number of frequencies at which the reduced model is checked against the full equations.
_SHORTEST = 0.5
# Smallest radius of the electrodes over that of the disk.


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
    rounds: int = ROUNDS,
    progress: Callable[[str], None] = lambda _: None,
    enough: float = 0.0,
    hopeless: float = math.inf,
    jobs: int = 1,
    outside: Callable[[Disk2D], Outside] | None = None,
) -> FittedDisk:
    """Fit the disk; parameters and errors raised as for `finite_disk`.

    `hopeless`: rms of ln Z that a description must not exceed; if the most promising places lead to no such one,
    FitError is raised. `jobs`: number of processes. `outside`: returns the effects to be fitted, too, for the disk.
    """
    disk, full, model, electrode = _posed(task, progress)
    progress(f"fitting {disk.step}")
    beside = Outside() if outside is None else outside(model)
    law, descent, error = _descend(disk, full, model, task.free, rounds, (enough, hopeless), jobs, beside)
    return FittedDisk(disk, replace(model, law=law), descent, error, electrode)


def smoothly_fitted(task: FitTask, progress: Callable[[str], None], jobs: int) -> FittedDisk:
    """Return where the disk probably is if something on its faces changes single resonances beyond recognition.

    Raises as `fitted_disk`. No descent has ended there: it needs what is missing.
    """
    disk, full, bare, electrode = _posed(task, progress)
    coordinates, recordings = _parts(disk, bare, task.free)
    priors = tensor_priors(disk)
    x, evaluations = smoothest(disk, bare, recordings, coordinates, priors, jobs)
    bare, x = _at_resonance(disk, bare, coordinates, x)
    values, _ = coordinates.forward(x)
    checked, error = _checked(disk, full, bare.replace({name: values[name] for name in bare.parameters()}))
    model = replace(checked, loadable=cache(partial(loadable_disk, _ratio(disk), progress, electrode)))
    recordings = [replace(one, model=model) for one in recordings]
    return FittedDisk(disk, model, judged(recordings, coordinates, priors, x, False, evaluations), error, electrode)


def _posed(task: FitTask, progress: Callable[[str], None]) -> tuple[BareDisk, FullDisk, Disk2D, float]:
    """Return the disk within reach, its mesh, its model with the library's constants, and its electrodes' radius."""
    disk = bare_disk(task, NAME, round_one=True, frees=True)
    electrode, disk = _electrode(disk), _within_reach(disk)
    full, reduced = reduced_disk(_ratio(disk), progress, electrode)
    odd = cache(partial(odd_disk, _ratio(disk), progress))
    return disk, full, replace(_model(disk, reduced), odd=odd), electrode


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


def _at_resonance(disk: BareDisk, model: Disk2D, coordinates: Coordinates, x: Reals) -> tuple[Disk2D, Reals]:
    """Return model and coordinates of the same causal disk by its constants at its thickness resonance."""
    values, _ = coordinates.forward(x)
    law, tensor = at_resonance(disk.sweeps, values, model.name, model.law)
    return replace(model, law=law), coordinates.inverse({**values, **tensor})


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
    outside: Outside,
) -> tuple[LossLaw, Descent, float]:
    """Return law, deepest minimum, and estimated error of the reduced model there; `limits`: enough and hopeless."""
    coordinates, recordings = _parts(disk, model, free)
    coordinates, priors = outside.extended(coordinates), (*tensor_priors(disk), *outside.priors)
    if outside.added:
        x, evaluations = _by_random_starts(disk, (model, outside), recordings, coordinates, priors, [], limits, jobs)
    else:
        x, evaluations = searched(disk, model, recordings, coordinates, priors, *limits, jobs)
        if limits[0] == 0 and not _near_noise(_rough(recordings, model), coordinates, x, _FOUND):
            made = model, outside
            x, more = _by_random_starts(disk, made, recordings, coordinates, priors, [x], limits, jobs)
            evaluations += more
    model, x = _at_resonance(disk, model, coordinates, x)
    ends: list[tuple[float, LossLaw, Descent, float]] = []
    for law in (model.law, CONSTANT):
        made = replace(model, law=law), outside
        descent, error = _settled(disk, full, made, coordinates, recordings, priors, x, rounds)
        evaluations += descent.evaluations
        left = left_of(descent.objective.recordings, coordinates, descent.x)
        ends.append((left, law, descent, error))
        if _near_noise(descent.objective.recordings, coordinates, descent.x, _NOISE):
            break
        x = descent.x
    _, law, descent, error = min(ends, key=lambda end: end[0])
    return law, replace(descent, evaluations=evaluations), error


def _by_random_starts(
    disk: BareDisk,
    made: tuple[Disk2D, Outside],
    recordings: Sequence[Recording],
    coordinates: Coordinates,
    priors: Sequence[Known],
    known: Sequence[Reals],
    limits: tuple[float, float],
    jobs: int,
) -> tuple[Reals, int]:
    """Return the best minimum from the library, from `known` places and from random tensors; see `lateral_search`.

    Raises FitError if it leaves more than is hopeless.
    """
    model, outside = made
    rough = replace(model, rough=True)
    scaled = [{**outside.start, **one} for one in matched(disk, rough, coordinates, outside.start)]
    rng = np.random.default_rng(1)

    def drawn(count: int) -> list[Reals]:
        tensors = drawn_starts(disk, scaled[:_SCALED], coordinates, count, rng)
        return [outside.drawn(x, coordinates.free, rng) for x in tensors]

    def few(device: Disk2D) -> list[Recording]:
        whole = outside.around(device, outside.start)
        if device.damping > 0:
            return [replace(Broadening.of(one).by(device.damping, _SEARCHED), model=whole) for one in recordings]
        return [replace(thinned(one, _SEARCHED), model=whole) for one in recordings]

    exact = [few(replace(model, law=law)) for law in (model.law, CONSTANT)]
    quick, wide = few(rough), few(replace(rough, damping=DAMPING))
    given = [*known, *map(coordinates.inverse, scaled)]
    enough, hopeless = limits
    effort = _WITH_WIRES if outside.added else _ALONE
    x, kind, evaluations = lateral(quick, exact, coordinates, priors, given, drawn, effort, enough, jobs, wide)
    left = left_of(exact[kind], coordinates, x) / math.sqrt(sum(one.sweep.frequency.size for one in exact[kind]))
    if left > hopeless:
        raise FitError(f"a disk of finite diameter leaves {left:.2g} of ln Z, more than {hopeless:.2g}")
    return x, evaluations


def _rough(recordings: Sequence[Recording], model: Disk2D) -> list[Recording]:
    return [replace(thinned(one), model=replace(model, rough=True)) for one in recordings]


def _near_noise(recordings: Sequence[Recording], coordinates: Coordinates, x: Reals, times: float) -> bool:
    """Return whether at most so many times the noise is left."""
    return left_of(recordings, coordinates, x) < times * math.sqrt(
        sum(float(np.sum(2 * one.noise**2)) for one in recordings)
    )


def _settled(
    disk: BareDisk,
    full: FullDisk,
    made: tuple[Disk2D, Outside],
    coordinates: Coordinates,
    recordings: Sequence[Recording],
    priors: Sequence[Known],
    x: Reals,
    rounds: int,
) -> tuple[Descent, float]:
    """Return the minimum near `x`, and the estimated error of the reduced model there."""
    model, outside = made
    error, before, settled, evaluations = math.inf, math.inf, False, 0
    for _ in range(rounds):
        values, _ = coordinates.forward(x)
        model, error = _checked(disk, full, model.replace({name: values[name] for name in model.parameters()}))
        device = outside.around(model, values)
        recordings = [at_level(replace(each, model=device), coordinates, x) for each in recordings]
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
    tensor = tensor_of(starts(disk)[0], layer)
    made = Disk2D(layer, tensor, sizes["area"], sizes["thickness"], sizes["density"], reduced)
    return replace(made, law=CausalConstantQ(reference_of(disk.sweeps, made.parameters(), layer)))


def constants_named(layer: str, tensor: Tensor6mm) -> dict[str, complex]:
    """Return the ten constants and all derived ones by full name, SI."""
    plate = tensor.thickness
    named = {name: complex(getattr(tensor, name)) for name in CONSTANTS}
    named |= {"c33D": plate.c33D, "h33": plate.h33, "kt": plate.kt}
    return {f"{layer}.{name}": value for name, value in named.items()} | radial_named(layer, tensor.radial)
