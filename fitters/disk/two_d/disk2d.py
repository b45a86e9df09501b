"""Fitter `disk2d`: all ten complex constants of a round disk from its own recording, in two dimensions.

Radial overtones and the edge mode, which overlap the thickness resonance of a real disk, are part of the model
(`models/disk2d`), so the constants need not compensate for them. Constants are passive by construction; losses are
causal, or the same at all frequencies without their companion where that describes the recordings better.
"""

import time
from collections.abc import Callable, Mapping
from dataclasses import replace

from ....models.base.face_loads import Coat, DeadLayer
from ....models.constants.passivity import passivity_margin
from ....models.disk2d.disk_model import Disk2D
from ....models.disk2d.training import HIGHEST
from ...engine.covariance import estimate
from ...engine.descent import Descent
from ...engine.fitted_model import FittedModel
from ...interface import FitResult, FitTask
from ..bare_disk import BareDisk
from ..planar_result import Named, planar_answer
from .determined_constants import undetermined
from .disk_fit import NAME, ROUNDS, FittedDisk, constants_named, fitted_disk
from .disk_under_diagnosis import diagnosable
from .predictions import predictions, sentence
from .reference import in_words, tensor_of
from .tensor_start import unusual

_PREDICTED = 0.87
# Part of the model's highest frequency up to which modes are predicted: 1.3 times the thickness resonance.


class Disk2DFitter:
    """All ten complex constants of a free round disk, in two dimensions."""

    name = NAME
    version = "3"
    summary = "all ten complex constants of a round disk in two dimensions: radial, edge and thickness modes together"

    has_laws = True
    loads = (Coat, DeadLayer)

    def fit(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FitResult:
        """Fit the ten constants to all recordings of the bare disk.

        Raises FitError if none of the recordings is of a round bare disk of diameter/thickness 2 to 60 below 1.5 times
        its thickness resonance.
        """
        return finite_disk(task, progress=progress)

    def fitted_model(self, task: FitTask, progress: Callable[[str], None] = lambda _: None) -> FittedModel:
        """Return the fitted disk, for a diagnosis. Raises FitError as `fit` does."""
        return diagnosable(fitted_disk(task, progress=progress))


def finite_disk(
    task: FitTask,
    rounds: int = ROUNDS,
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


def disk_result(found: FittedDisk, seconds: float) -> FitResult:
    """Return the result of a fit that took this long."""
    disk, descent = found.disk, found.descent
    layer = disk.layer.name

    def make(values: Mapping[str, float]) -> dict[str, complex]:
        return constants_named(layer, tensor_of(values, layer))

    tensor = tensor_of(descent.objective.coordinates.forward(descent.x)[0], layer)
    says = (
        *([f"Electrodes end at {found.electrode:.4g} of the disk's radius."] if found.electrode < 1 else []),
        f"Constants {in_words(found.model.law)}. The reduced model is "
        f"accurate to {found.error:.1g} of the capacitance (estimated from its residual in the full equations).",
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
