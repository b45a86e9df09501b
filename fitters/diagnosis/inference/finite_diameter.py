"""Test for a finite diameter: compare the two-dimensional disk model with the best one-dimensional explanation.

Radial overtones and the edge mode are no small addition to the thickness mode, and no extension of the one-dimensional
model describes them to the noise. The whole disk is therefore fitted anew, with all ten constants, by `disk2d`.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.special import chdtri, expit

from ....models.base.arrays import Frequencies, Impedances
from ....models.base.face_loads import Dot
from ....models.disk2d.disk_model import Disk2D
from ....models.disk2d.matrices import CONSTANTS
from ....models.effects import find_effect
from ....models.effects.base.effect import TERMINALS
from ....models.stack import LossLaw
from ...disk.bare_disk import BareDisk, bare_disk
from ...disk.two_d.disk2d import disk_result
from ...disk.two_d.disk_fit import FittedDisk
from ...disk.two_d.disk_under_diagnosis import diagnosable, plate_of, thinner
from ...disk.two_d.tensor_start import deviations, implausibility
from ...disk.two_d.valley_search import FEW
from ...engine.fitted_model import FittedModel, Seed
from ...engine.recording import Recording
from ...interface import UNCOMPUTABLE, Constant, Curve, FitError, FitResult, FitTask
from ..decision_rules import ASTRAY, COARSENED_RIM, NAMED
from ..findings import Finding, FitSummary, Size
from ..hypotheses.instrument_artefacts import UNKNOWN
from ..hypotheses.problem import Candidate
from ..search.refit import Refit
from ..validation.bands import guilty_bands
from .disk_beside import disk_beside
from .disk_with_wires import DESCRIBED, is_narrow, ratio_of

NAME = "lateral-modes"
_SHOWS = 0.02
"""Rms of ln(Z_model/Z) of the one-dimensional fit above which the test is run, since lateral modes are strong: the best
plate model leaves 0.27, 0.11 and 0.035 at diameter/thickness 10, 20 and 40."""
_RIM, _FALL, _LEAST = 7.0, -1.4, 0.3
"""Rms of ln Z that the best plate leaves of a disk, as a power of diameter/thickness (see `_SHOWS`), and the part of it
below which no rim is looked for."""
_SHOWN = 10.0
"""Prior odds that recordings show the rim of a disk so narrow that it could: damped or apodized rims are rare."""
_LEFT = 0.1
"""Part of what a plate leaves of ln Z (rms) that a disk may leave to explain it."""
_DENSE = 100.0
"""chi2 from which noise no longer limits what a sweep says: the misfit of a disk is alike at neighbouring points."""
_MORE = 14
"""Number of parameters that the disk model has beyond a plate: seven complex constants."""


@dataclass(frozen=True, eq=False)
class DiskTried:
    """A disk of finite diameter as fitted to the bare disk's recordings, alone and with effects at its terminals."""

    alone: FittedDisk
    whole: FittedDisk
    beside: tuple[Candidate, ...]
    """Effects of the whole, at its terminals or in its laws."""
    result: FitResult
    """Of the whole."""

    @property
    def leaves_much(self) -> bool:
        """Whether it leaves far more than noise and its own error, with all effects that were found beside it."""
        return self.result.chi2_per_dof > _DENSE and self.result.rms_log_error > DESCRIBED

    @property
    def with_a_dot(self) -> bool:
        """Whether a dot lies on a face: then the model takes ten times as long, and only laws are sought beside."""
        return any(one.effect.lies_on_faces is Dot for one in self.beside)

    @property
    def model(self) -> FittedModel:
        """The disk without effects, with the law of losses that fits with them; a search begins with them.

        On a few hundred points of each sweep where it leaves much: points between say the same. With something on a
        face fewer and the quick model must do.
        """
        bare = self.alone
        if self.with_a_dot:
            bare = thinner(bare, FEW)
        elif self.leaves_much:
            bare = thinner(bare)
        objective = bare.descent.objective
        recordings = [_with_law(one, self.whole.model.law, rough=self.with_a_dot) for one in objective.recordings]
        same = objective.with_recordings(recordings)
        made = diagnosable(replace(bare, model=self.whole.model, descent=replace(bare.descent, objective=same)))
        names = frozenset((one.effect.name, one.where) for one in self.beside)
        values, _ = self.whole.descent.objective.coordinates.forward(self.whole.descent.x)
        return replace(made, scale=plate_of(self.whole), seeds=(Seed(names, values),) if names else ())


def _with_law(recording: Recording, law: LossLaw, *, rough: bool) -> Recording:
    model = recording.model
    return replace(recording, model=replace(model, law=law, rough=rough)) if isinstance(model, Disk2D) else recording


@dataclass(frozen=True, eq=False)
class FiniteDisk:
    """A finite diameter that is more probable than what a plate can have."""

    tried: DiskTried
    probability: float

    @property
    def result(self) -> FitResult:
        """The fit in two dimensions."""
        return self.tried.result


def bare_alone(task: FitTask) -> FitTask | None:
    """Return the task with the recordings of the bare disk alone; None if no round one was recorded."""
    disk = _disk_of(task)
    return None if disk is None else replace(task, sweeps={disk.step: task.sweeps[disk.step]})


def shows_early(task: FitTask, null: Refit) -> bool:
    """Return whether the plate leaves as much as a rim would, so that the disk is fitted before anything else."""
    disk = _disk_of(task)
    return disk is not None and is_narrow(disk) and _may_be_a_rim(disk, _rms(null))


def may_be_left(task: FitTask, unexplained: float) -> bool:
    """Return whether a plate with effects leaves as much unexplained of ln Z (rms) as a rim would."""
    disk = _disk_of(task)
    return disk is not None and _may_be_a_rim(disk, unexplained)


def _disk_of(task: FitTask) -> BareDisk | None:
    """Return the bare disk of a task; None if no round one was recorded."""
    try:
        return bare_disk(task, "disk2d", round_one=True, frees=True)
    except FitError:
        return None


def _may_be_a_rim(disk: BareDisk, left: float) -> bool:
    """Return whether a plate leaves as much of ln Z (rms) as it would of a disk of this width."""
    return left > max(_SHOWS, _LEAST * _RIM * ratio_of(disk) ** _FALL)


def tried(
    task: FitTask, null: Refit, best: Refit | None, progress: Callable[[str], None], jobs: int = 1
) -> DiskTried | None:
    """Fit the two-dimensional disk, and look for effects at its terminals.

    Return None if there is no recording of a round bare disk, if the disk is too wide for its rim to matter, or if the
    `best` explanation by a plate (the one without effects, if there is no other yet) leaves too little.
    """
    left, disk = _rms(best or null), _disk_of(task)
    if disk is None or left < _SHOWS or not _may_be_a_rim(disk, _rms(null)):
        return None
    # A plate with effects at its terminals may leave less than a disk without them, until the disk has them, too. If
    # it has none, the disk alone must already explain as much as a finding must.
    beside = best is None or any(one.where == TERMINALS for one in best.effects)
    hopeless = _rms(null) if beside else left * float(np.sqrt(1 - NAMED))
    progress("fitting the disk in two dimensions")
    began = time.perf_counter()
    try:
        found = disk_beside(task, hopeless, progress, jobs, _rms(null))
        return DiskTried(found.alone, found.whole, found.beside, disk_result(found.whole, time.perf_counter() - began))
    except UNCOMPUTABLE:  # a ceramic may have run to where its stiffness has no inverse
        return None


def leaves_no_other(made: DiskTried, null: Refit) -> bool:
    """Return whether the disk leaves so little that no plate, whatever effects it has, needs to be looked for.

    It then explains the misfit as `explained` means it: a tenth of the change of ln Z remains, or less. But one whose
    constants are further from the ceramic's than those of one disk in twenty may stand for a plate with an effect.
    """
    away = deviations(made.alone.disk, _tensor(made.alone.disk, made.result))
    usual = float(away @ away) < float(chdtri(away.size, ASTRAY))
    return usual and made.result.rms_log_error < _LEFT * _rms(null)


def _tensor(disk: BareDisk, result: FitResult) -> dict[str, complex]:
    """Return the ten constants of a disk by their names."""
    constants = {name: result.constants[f"{disk.layer.name}.{name}"] for name in CONSTANTS}
    return {name: complex(one.re, one.im) for name, one in constants.items()}


def finite(made: DiskTried, task: FitTask, null: Refit, best: Refit) -> FiniteDisk | None:
    """Return the disk if it is more probable than the `best` one-dimensional explanation."""
    probability = _probability(task, made.result, null, best)
    return FiniteDisk(made, probability) if probability > NAMED else None


def _rms(one: Refit) -> float:
    """Return the largest rms of ln(Z_model/Z) of a recording."""
    return max(float(np.sqrt(np.mean(np.abs(ratio) ** 2))) for ratio in one.objective.log_ratios(one.descent.x))


def _coarseness(short: float) -> float:
    """Return how much ln evidence counts as one nat if this much is missing."""
    return 1 + COARSENED_RIM * max(0.0, short)


def _probability(task: FitTask, result: FitResult, null: Refit, best: Refit) -> float:
    """Return the probability of a finite diameter, treating the residual of either explanation as noise of its size.

    Ten free constants can imitate much that they do not cause, so they must be plausible for a ceramic. As for any
    effect, evidence is coarsened by the misfit of the better explanation. Every disk has a rim; what `_SHOWN` says is
    that the recordings of nearly every one show it.
    """
    plates = [_chi2_of(one, result) for one in (null, best)]
    chi2 = max(result.chi2_per_dof, 1.0)
    points = sum(curve.frequency.size for curve in result.curves)
    gain = points * float(np.log(max(min(plates), 1.0) / chi2)) - _MORE / 2 * float(np.log(2 * points))
    disk = bare_disk(task, "disk2d", round_one=True, frees=True)
    against = implausibility(disk, _tensor(disk, result))
    log_odds = gain / _coarseness(points * float(np.log(min(chi2, *plates)))) - against
    return float(expit(log_odds + float(np.log(_SHOWN)))) * max(0.0, 1 - chi2 / max(plates[0], chi2))


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


def beside(finite: FiniteDisk, found: Sequence[Finding]) -> list[Finding]:
    """Return the findings on the disk; none whose probability is below one half.

    Each is conditional on the finite diameter, whose probability it is multiplied by. What remains unknown does so in
    either case.
    """
    known = [replace(one, probability=finite.probability * one.probability) for one in found if one.effect != UNKNOWN]
    return [*(one for one in known if one.probability >= NAMED), *(one for one in found if one.effect == UNKNOWN)]


def curves(of_disk: Sequence[Curve], of_null: Sequence[Curve]) -> tuple[Curve, ...]:
    """Return one final curve per initial curve; outside the range of the two-dimensional fit it is unchanged.

    Between points that the fit left out the curves are interpolated.
    """
    left = list(of_disk)
    made: list[Curve] = []
    for curve in of_null:
        own = next((one for one in left if one.step == curve.step and set(one.frequency) <= set(curve.frequency)), None)
        if own is None:
            made.append(curve)
            continue
        left = [one for one in left if one is not own]
        inside = (curve.frequency >= own.frequency[0]) & (curve.frequency <= own.frequency[-1])
        fitted = curve.fitted.copy()
        fitted[inside] = _at(curve.frequency[inside], own.frequency, own.fitted)
        explained = None if own.explained is None else fitted.copy()
        if explained is not None and own.explained is not None:
            explained[inside] = _at(curve.frequency[inside], own.frequency, own.explained)
        made.append(replace(curve, fitted=fitted, explained=explained))
    return tuple(made)


def _at(frequency: Frequencies, known: Frequencies, Z: Impedances) -> Impedances:
    """Return an impedance at frequencies between those at which it is known, by a cubic spline of its logarithm."""
    if np.array_equal(frequency, known):
        return Z
    log_Z = np.log(np.abs(Z)) + 1j * np.unwrap(np.angle(Z))
    return np.asarray(np.exp(CubicSpline(known, log_Z)(frequency)), np.complex128)


def _sizes(constants: Mapping[str, Constant], layer: str) -> dict[str, Size]:
    """Return the lateral constants, which the thickness mode does not determine."""
    found = {name: constants.get(f"{layer}.{name}") for name in ("c11E", "c12E", "c13E")}
    return {name: Size(one.re, one.u_re or 0.0, one.unit) for name, one in found.items() if one is not None}
