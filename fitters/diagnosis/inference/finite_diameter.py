"""Test for a finite diameter: compare the two-dimensional disk model with the best one-dimensional explanation.

Radial overtones and the edge mode are no small addition to the thickness mode, and no extension of the one-dimensional
model describes them to the noise. The whole disk is therefore fitted anew, with all ten constants, by `disk2d`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import expit

from ....models.disk2d.matrices import CONSTANTS
from ....models.effects import find_effect
from ...disk.bare_disk import bare_disk
from ...disk.two_d.disk2d import finite_disk
from ...disk.two_d.tensor_start import implausibility
from ...interface import Curve, FitError, FitResult, FitTask
from ..decision_rules import NAMED
from ..findings import Finding, Size
from ..hypotheses.hypothesis import coarseness
from ..search.refit import Refit
from ..validation.bands import guilty_bands

NAME = "lateral-modes"
_SHOWS = 0.02
"""Rms of ln(Z_model/Z) of the one-dimensional fit above which the test is run, since lateral modes are strong: the best
plate model leaves 0.27, 0.11 and 0.035 at diameter/thickness 10, 20 and 40."""
_DESCRIBED = 6e-3
"""Rms of ln(Z_model/Z) below which the two-dimensional fit is complete: the accuracy of its reduced model."""
_ROUNDS = 4
"""Budget: descents in two dimensions, of at most twelve steps each."""
_MORE = 14
"""Number of parameters that the disk model has beyond a plate: seven complex constants."""


@dataclass(frozen=True, eq=False)
class FiniteDisk:
    """Fit of the bare disk's recordings by a disk of finite diameter."""

    result: FitResult
    probability: float

    @property
    def described(self) -> bool:
        """Whether the residual is within the accuracy of the two-dimensional model."""
        return self.result.rms_log_error < _DESCRIBED


def finite(task: FitTask, null: Refit, best: Refit, progress: Callable[[str], None]) -> FiniteDisk | None:
    """Fit the two-dimensional disk; return it if it is more probable than the `best` one-dimensional explanation.

    Return None otherwise: also if there is no recording of a round bare disk, if the disk is too wide for its rim to
    matter, or if the best explanation leaves too little for lateral modes.
    """
    left = max(float(np.sqrt(np.mean(np.abs(ratio) ** 2))) for ratio in best.objective.log_ratios(best.descent.x))
    if left < _SHOWS:
        return None
    progress("fitting the disk in two dimensions")
    try:
        result = finite_disk(task, _ROUNDS, enough=_DESCRIBED)
    except FitError:
        return None
    probability = _probability(task, result, null, best)
    return FiniteDisk(result, probability) if probability > NAMED else None


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
    short = points * float(np.log(min(chi2, *plates)))
    disk = bare_disk(task, "disk2d", round_one=True, frees=True)
    layer = disk.layer.name
    found = {name: complex(one.re, one.im) for name, one in result.constants.items()}
    against = implausibility(disk, {name: found[f"{layer}.{name}"] for name in CONSTANTS})
    log_odds = gain / coarseness(short) - against
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


def finding_of(finite: FiniteDisk, null: Refit, held_before: float) -> Finding:
    """Return the finding, with the bands in which the one-dimensional fit fails."""
    layer = next(iter(finite.result.constants)).partition(".")[0]
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
        parameters=_sizes(finite.result, layer),
        chi2_per_dof_before=null.chi2_per_dof,
        chi2_per_dof_after=finite.result.chi2_per_dof,
        held_out_before=held_before,
        held_out_after=float("nan"),
        alternatives=(),
        says=find_effect(NAME).says.format(where=where)
        + f" Fitted in two dimensions, {finite.result.rms_log_error:.2g} is left of ln Z (root mean square).",
    )


def curves(finite: FiniteDisk, of_null: tuple[Curve, ...]) -> tuple[Curve, ...]:
    """Return one final curve per initial curve; outside the range of the two-dimensional fit it is unchanged."""
    left = list(finite.result.curves)
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


def _sizes(result: FitResult, layer: str) -> dict[str, Size]:
    """Return the lateral constants, which the thickness mode does not determine."""
    found = {name: result.constants.get(f"{layer}.{name}") for name in ("c11E", "c12E", "c13E")}
    return {name: Size(one.re, one.u_re or 0.0, one.unit) for name, one in found.items() if one is not None}
