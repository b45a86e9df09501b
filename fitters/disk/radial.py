"""Fitter `radial`: least squares on the radial modes of a round disk, with finite thickness and causal losses.

Unlike the thin disk of IEEE Std 176 the model also moves through its thickness (`models/disk/radial.py`), and its
constants have the dispersion that causality requires for their losses. Both shift the overtone, in opposite directions.
"""

import math
import time
from collections.abc import Callable, Mapping
from dataclasses import replace

import numpy as np

from ...models.constants.piezo_constants import Radial
from ...models.constants.sherrit import radial_constants
from ...models.disk.radial import RadialError
from ...models.disk.round_disk import RadialDisk
from ...models.effects.base.scale import equivalent_plate
from ...models.stack import CausalConstantQ
from ..engine.descent import Descent, settle
from ..engine.fitted_model import FittedModel
from ..engine.plausibility import few_points
from ..engine.recording import Recording
from ..interface import FitError, FitResult, FitTask
from .bare_disk import BareDisk, bare_disk
from .critical_frequencies import linewidth
from .planar_result import (
    PLANAR_UNITS,
    Named,
    disk_priors,
    passivity_says,
    planar_answer,
    planar_coordinates,
    plate_priors,
    radial_named,
    radial_of,
)
from .radial_coordinates import RADIAL_CONSTANTS, plate_blocks, radial_constants_block
from .radial_modes import Peaks, radial_peaks, second_missing

RADIAL_TOGETHER = ("s12E", "d31")
"""Constants represented by Poisson's ratio and the coupling."""
_BELOW_THICKNESS_MODE = 0.4
_OVERTONES = 4.6
# Highest frequency over fs1: the third resonance is at 4.2 fs1. Above it, wavelengths are no longer long compared with
# the thickness of most disks.


class RadialLeastSquares:
    """Least squares on the radial modes, thickness-corrected and causal, with standard uncertainties."""

    name = "radial"
    version = "1"
    summary = "least squares on the radial modes of a round disk: finite thickness, causal losses, uncertainties"

    has_laws = True

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the radial constants to all recordings of the bare disk.

        Raises FitError if they show no radial resonance, or only the first one and nothing is known of s12E.
        """
        began = time.perf_counter()
        disk, descent, reference = _fitted(task, progress)
        seconds = time.perf_counter() - began
        return radial_answer(Named(self.name, self.version), disk, descent, reference, seconds)

    def fitted_model(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FittedModel:
        """Return the fitted disk, for a diagnosis. Raises FitError as `fit` does."""
        disk, descent, reference = _fitted(task, progress)
        layer = disk.layer.name
        clamped = radial_of(descent.objective.coordinates.forward(descent.x)[0], layer).eps33p.real
        capacitance = clamped * disk.sizes["area"].re / disk.sizes["thickness"].re
        plate = equivalent_plate(layer, capacitance, reference, CausalConstantQ(reference))
        return FittedModel(descent, plate, PLANAR_UNITS)


def _fitted(task: FitTask, progress: Callable[[str], None]) -> tuple[BareDisk, Descent, float]:
    """Return the recordings' part with the radial modes, its fit, and the reference frequency (Hz)."""
    whole = bare_disk(task, RadialLeastSquares.name, round_one=True, frees=True)
    progress(f"fitting {whole.step}")
    peaks = radial_peaks(whole)
    disk, start = radial_band(whole, peaks), radial_start(whole, peaks)
    return disk, _descend(disk, start, peaks.frequencies[0], task.free), peaks.frequencies[0]


def radial_answer(fitter: Named, disk: BareDisk, descent: Descent, reference: float, seconds: float) -> FitResult:
    """Return the result of a descent of `radial_model`; `reference` in Hz."""
    layer = disk.layer.name

    def make(values: Mapping[str, float]) -> dict[str, complex]:
        return radial_named(layer, radial_of(values, layer))

    radial = radial_of(descent.objective.coordinates.forward(descent.x)[0], layer)
    says = (
        f"Constants at {reference / 1e3:.5g} kHz, with causal losses. Planar coupling kp "
        f"{radial.kp.real:.4f} (data sheets), kp_IEEE {radial.kp_IEEE.real:.4f}: defined differently.",
        passivity_says(radial),
        *few_points(disk.sweeps, reference, 1 / radial.Qm),
    )
    return planar_answer(fitter, disk, descent, make, says, seconds)


def radial_top(disk: BareDisk, first: float) -> float:
    """Return the upper frequency limit of the model, Hz; `first`: the first resonance, Hz."""
    return min(_BELOW_THICKNESS_MODE * disk.expected_thickness_mode, _OVERTONES * first)


def radial_band(disk: BareDisk, peaks: Peaks) -> BareDisk:
    """Return the part of the recordings with the radial modes, far below the thickness mode."""
    return disk.between(0.0, radial_top(disk, peaks.frequencies[0]))


def radial_start(disk: BareDisk, peaks: Peaks) -> Radial:
    """Return start constants: Sherrit's closed form applied to the peaks, with every loss that of the first resonance.

    The peaks are first shifted to those of a thin disk with the same constants.
    """
    fs1, fp1, fs2 = peaks.frequencies
    ratio = fs2 / fs1 * _slowed(disk, 2.06) / _slowed(disk, 5.4) if fs2 is not None else _ratio_beforehand(disk, fs1)
    low, high = linewidth(*peaks.first, "the first radial resonance")
    loss = 1 / complex(1, -max(high - low, 1e-3 * fs1) / fs1)
    turn = np.sqrt(loss)
    f = np.concatenate([sweep.frequency for sweep in disk.sweeps])
    Z = np.concatenate([sweep.impedance for sweep in disk.sweeps])
    away = np.argmax(np.abs(np.log(f / fs1))) if f.min() > 0.8 * fs1 else np.argmin(f)
    constants = radial_constants(
        fs1 * turn, ratio * fs1 * turn, fp1 * turn, 1e-8 / loss, disk.radius, disk.sizes["density"].re
    )
    try:
        shape = radial_model(disk, constants, fs1)
    except RadialError as error:
        raise FitError(f"the radial resonances found are those of no material: {error}") from None
    level = abs(shape.impedance(f[away : away + 1])[0] / Z[away])
    root = math.sqrt(level)
    return Radial(constants.s11E, constants.s12E, constants.d31 * root, constants.eps33T * level)


def _slowed(disk: BareDisk, eta: float) -> float:
    """Return the factor of the resonance at `eta` due to finite thickness: 1 - alpha^2 (t/D)^2 (eta^2/6 + 1/4)."""
    alpha = plate_priors(disk)[f"{disk.layer.name}.alpha"]
    return 1 - (alpha * disk.sizes["thickness"].re / (2 * disk.radius)) ** 2 * (eta**2 / 6 + 0.25)


def _ratio_beforehand(disk: BareDisk, fs1: float) -> float:
    """Return fs2/fs1 from the known Poisson's ratio, by inverting Sherrit's polynomial."""
    v = disk.layer.values
    if "s11E" not in v or "s12E" not in v or v["s12E"].u == 0:
        raise second_missing(disk, fs1)
    ratios = np.linspace(2.45, 2.8, 71)
    sigmas = [radial_constants(1, r, 1.1, 1e-8, 1.0, 1.0).sigma_p.real for r in ratios.tolist()]
    return float(np.interp(v["s12E"].re / v["s11E"].re, -np.array(sigmas), ratios))


def radial_model(disk: BareDisk, constants: Radial, reference: float) -> RadialDisk:
    """Return the causal disk of finite thickness; its constants refer to the frequency `reference`, Hz.

    Raises RadialError for constants of no material.
    """
    sizes, causal = disk.sizes, CausalConstantQ(reference)
    thin = RadialDisk.of(disk.layer.name, constants, sizes["area"].re, sizes["thickness"].re, sizes["density"].re)
    arm = replace(thin.arm, laws=dict.fromkeys(("s11E", "s12E", "d31"), causal))
    return replace(thin, arm=arm, eps_law=causal).replace(plate_priors(disk))


def _descend(disk: BareDisk, start: Radial, reference: float, free: tuple[str, ...] | None) -> Descent:
    at, model = disk.layer.name, radial_model(disk, start, reference)
    plate = [f"{at}.alpha", f"{at}.d33f"]
    blocks = (radial_constants_block(at), *plate_blocks(at))
    coordinates = planar_coordinates(disk, "radial", blocks, model, RADIAL_CONSTANTS, RADIAL_TOGETHER, free)
    recordings = [
        Recording(disk.step, sweep, model, noise) for sweep, noise in zip(disk.sweeps, disk.noises, strict=True)
    ]
    priors = disk_priors(disk, RADIAL_CONSTANTS)
    # The thickness correction is freed last: far from the minimum it would absorb the overtone's error.
    held = coordinates.without(*plate)
    first = settle(recordings, held, priors, held.x)
    begin = coordinates.inverse(held.forward(first.x)[0])
    last = settle(recordings, coordinates, priors, begin)
    return replace(last, start=coordinates.x, evaluations=first.evaluations + last.evaluations)
