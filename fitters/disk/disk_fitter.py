"""Fitter `disk`: radial and thickness mode of a bare round disk in one fit, with causal losses.

One set of capacitances serves both modes (`models/disk/round_disk.py`): eps33S = eps33T (1 - kp^2)(1 - kt^2) holds
exactly. The losses of permittivity and stiffness cause dispersion between the two bands.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...models.constants.causal import continued
from ...models.constants.piezo_constants import Radial
from ...models.disk.radial import RadialError
from ...models.disk.round_disk import BothModes
from ...models.stack import CausalConstantQ, Piezo, Stack
from ..engine.descent import ROUGH, Descent, descend, settle
from ..engine.fitted_model import FittedModel
from ..engine.objective import Objective
from ..engine.parameters.assembly import stack_of
from ..engine.plausibility import few_points
from ..engine.recording import Recording
from ..interface import FitError, FitResult, FitTask
from ..uncertainty.derived import derived_of
from .bare_disk import BareDisk, bare_disk
from .disk_coordinates import ARM_CONSTANTS, PLATE_CONSTANTS, both_modes_constants
from .planar_result import (
    PLANAR_UNITS,
    Named,
    disk_priors,
    passivity_says,
    planar_answer,
    planar_coordinates,
    plate_priors,
    radial_named,
)
from .radial import radial_band, radial_start
from .radial_coordinates import plate_blocks
from .radial_modes import radial_peaks
from .sherrit_thickness import thickness_pair

DISK_CONSTANTS = (*PLATE_CONSTANTS, *ARM_CONSTANTS)
_SPLIT = 0.4
# In units of the thickness antiresonance: below, a recording counts as one of the radial modes, above as one of the
# thickness mode; each part has its own misfit.


class DiskFitter:
    """Radial and thickness mode of a bare disk in one fit."""

    name = "disk"
    version = "1"
    summary = "radial and thickness mode of a round disk in one fit, causal losses, one set of capacitances"

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit all constants of both modes to the recordings of the bare disk.

        Raises FitError if one of the modes is missing in the recordings.
        """
        began = time.perf_counter()
        whole, model, references, descent = _fitted(task, progress)
        seconds = time.perf_counter() - began
        return disk_answer(Named(self.name, self.version), whole, descent, (model, references), seconds)

    def fitted_model(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FittedModel:
        """Return the fitted disk, for a diagnosis. Raises FitError as `fit` does."""
        _, model, _, descent = _fitted(task, progress)
        return FittedModel(descent, model.stack, PLANAR_UNITS)


def _fitted(task: FitTask, progress: Callable[[str], None]) -> tuple[BareDisk, BothModes, tuple[float, float], Descent]:
    """Return the recordings, the model that the fit began with, its reference frequencies (Hz), and the fit."""
    whole = bare_disk(task, DiskFitter.name, round_one=True, frees=True)
    progress(f"fitting {whole.step}")
    model, references = disk_start(whole)
    return whole, model, references, _descend(whole, model, task.free)


def disk_answer(
    fitter: Named, disk: BareDisk, descent: Descent, of: tuple[BothModes, tuple[float, float]], seconds: float
) -> FitResult:
    """Return the result of a descent `of` a `disk_model` with its reference frequencies (Hz)."""
    layer, (model, references) = disk.layer, of

    def make(values: Mapping[str, float]) -> dict[str, complex]:
        plate = {f"{layer.name}.{n}": _complex(values, f"{layer.name}.{n}") for n in PLATE_CONSTANTS}
        return plate | derived_of(layer, values) | radial_named(layer.name, _radial(model, values, references[0]))

    values, _ = descent.objective.coordinates.forward(descent.x)
    radial, c33D = _radial(model, values, references[0]), _complex(values, f"{layer.name}.c33D")
    says = (
        f"Radial constants and eps33T at {references[0] / 1e3:.5g} kHz, thickness-mode constants at "
        f"{references[1] / 1e6:.5g} MHz, with causal losses between. Planar coupling kp {radial.kp.real:.4f} (data "
        f"sheets), kp_IEEE {radial.kp_IEEE.real:.4f}: defined differently.",
        passivity_says(radial),
        *few_points(disk.sweeps, references[0], 1 / radial.Qm),
        *few_points(disk.sweeps, references[1], c33D.imag / c33D.real),
    )
    return planar_answer(fitter, disk, descent, make, says, seconds)


def _complex(values: Mapping[str, float], name: str) -> complex:
    return complex(values[f"{name}.re"], values[f"{name}.im"])


def disk_start(disk: BareDisk) -> tuple[BothModes, tuple[float, float]]:
    """Return the model with constants from the peaks, and the reference frequencies (Hz) of radial and other ones."""
    peaks = radial_peaks(disk)
    fs1, name = peaks.frequencies[0], disk.layer.name
    radial = radial_start(radial_band(disk, peaks), peaks)
    pair = thickness_pair(disk, disk.between(0.5 * disk.expected_thickness_mode, np.inf).sweeps)
    try:
        return disk_model(disk, radial, pair.parameters(name), (fs1, pair.fp)), (fs1, pair.fp)
    except RadialError as error:
        raise FitError(f"the radial resonances found are those of no material: {error}") from None


def disk_model(
    disk: BareDisk, radial: Radial, plate: Mapping[str, float], references: tuple[float, float]
) -> BothModes:
    """Return the causal disk of both modes; `plate`: parameters of its stack that differ from the build's.

    `references`: Hz, at which radial and thickness-mode constants have their stated values. Raises RadialError.
    """
    stack = stack_of(disk.build, disk.build.step(disk.step)).replace(plate)
    (layer,) = stack.layers
    if not isinstance(layer, Piezo):
        raise FitError(f"layer {layer.name!r} is not piezoelectric")
    causal = CausalConstantQ(references[1])
    stack = replace(stack, layers=(replace(layer, c_law=causal, h_law=causal, eps_law=causal),))
    both = BothModes.of(stack, layer.name, radial)
    laws = dict.fromkeys(ARM_CONSTANTS, CausalConstantQ(references[0]))
    return BothModes(both.stack, replace(both.arm, laws=laws)).replace(plate_priors(disk))


def _radial(model: BothModes, values: Mapping[str, float], reference: float) -> Radial:
    """Return the radial constants with eps33T at the radial reference (Hz)."""
    stack = _stack_of(model, values)
    (layer,) = stack.layers
    if not isinstance(layer, Piezo):
        raise FitError(f"layer {layer.name!r} is not piezoelectric")
    at = np.array([reference])
    laws = ((layer.c_law, layer.c33D), (layer.h_law, layer.h33), (layer.eps_law, layer.eps33S))
    c, h, eps = (complex(continued(law, value, at)[0][0]) for law, value in laws)
    s11, s12, d31 = (_complex(values, f"{layer.name}.{name}") for name in ARM_CONSTANTS)
    eps33p = eps / (1 - h**2 * eps / c)
    return Radial(s11, s12, d31, eps33p + 2 * d31**2 / (s11 + s12))


def _stack_of(model: BothModes, values: Mapping[str, float]) -> Stack:
    own = model.stack.parameters()
    return model.stack.replace({name: value for name, value in values.items() if name in own})


def disk_split(disk: BareDisk) -> float:
    """Return the frequency (Hz) that divides a recording into one of the radial modes and one of the thickness mode."""
    return _SPLIT * disk.expected_thickness_mode


def _descend(disk: BareDisk, model: BothModes, free: tuple[str, ...] | None) -> Descent:
    at = disk.layer.name
    sizes = [disk.size_name(name) for name in disk.sizes]
    plate = [f"{at}.alpha", f"{at}.d33f"]
    blocks = (both_modes_constants(at), *plate_blocks(at))
    coordinates = planar_coordinates(disk, "disk", blocks, model, DISK_CONSTANTS, ARM_CONSTANTS, free)
    split = disk_split(disk)
    recordings = [
        Recording(disk.step, sweep, model, noise)
        for part in (disk.between(0.0, split), disk.between(split, np.inf))
        for sweep, noise in zip(part.sweeps, part.noises, strict=True)
    ]
    priors = disk_priors(disk, DISK_CONSTANTS)
    # Sizes and thickness correction are freed last: far from the minimum they would absorb other constants' errors, and
    # a
    # density that is ten standard uncertainties off returns slowly.
    held = coordinates.without(*plate, *sizes)
    first = descend(Objective(recordings, held, priors), held.x, ROUGH)
    last = settle(recordings, coordinates, priors, coordinates.inverse(held.forward(first.x)[0]))
    return replace(last, start=coordinates.x, evaluations=first.evaluations + last.evaluations)
