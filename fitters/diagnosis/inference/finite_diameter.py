"""Is it the finite diameter? The disk in two dimensions against the recordings that a plate without rim leaves.

Radial overtones and the edge mode are no small addition to the thickness mode: no extension of the one-dimensional
model is right to the noise. So the whole disk is fitted anew, all ten constants, by the fitter `disk2d`.
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
"""Root mean square of ln(Z_model/Z) of the one-dimensional fit from which it is worth asking: lateral modes are not
faint. The best plate leaves 0.27, 0.11 and 0.035 at diameter/thickness 10, 20 and 40."""
_DESCRIBED = 6e-3
"""Root mean square of ln(Z_model/Z) up to which the disk is described: its reduced model is hardly better."""
_ROUNDS = 4
"""Descents in two dimensions, of at most twelve steps each. A budget."""
_MORE = 14
"""Parameters that the disk has and a plate has not: seven complex constants."""


@dataclass(frozen=True, eq=False)
class FiniteDisk:
    """The bare disk's recordings as a disk of finite diameter describes them."""

    result: FitResult
    probability: float

    @property
    def described(self) -> bool:
        """Whether what is left is what the two-dimensional model itself is worth."""
        return self.result.rms_log_error < _DESCRIBED


def finite(task: FitTask, null: Refit, best: Refit, progress: Callable[[str], None]) -> FiniteDisk | None:
    """Return the disk in two dimensions where it is more probable than the `best` explanation in one, else None.

    None too where there is no recording of a round bare disk, or one so wide that its rim does not matter, and where
    the best explanation leaves so little that no lateral modes can be in it.
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
    """Return how probable a finite diameter is, all that either explanation leaves counted as noise of its size.

    Ten free constants imitate much that is none of theirs: so they must be those of a ceramic. As for any effect, what
    is left may have a cause that imitates it, and evidence is as coarse as the better explanation is wrong. Beforehand
    the odds are even: every disk has a rim, and the only question is whether it is what one sees.
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
    """Return mean |ln(Z_model/Z)|^2 over its expectation from noise alone, where the result has points."""
    reached = {(curve.step, f) for curve in result.curves for f in curve.frequency.tolist()}
    squares = [
        np.abs(ratio[kept]) ** 2 / 2
        for recording, ratio in zip(one.objective.recordings, one.in_noise, strict=True)
        if (kept := np.array([(recording.step, f) in reached for f in recording.sweep.frequency.tolist()])).any()
    ]
    return float(np.mean(np.concatenate(squares)))


def finding_of(finite: FiniteDisk, null: Refit, held_before: float) -> Finding:
    """Return the finding; bands where the one-dimensional fit is off."""
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
    """Return the curves after, one for each before: beyond the reach of the two dimensions they stay as they were."""
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
    """Return the lateral constants that the thickness mode does not have."""
    found = {name: result.constants.get(f"{layer}.{name}") for name in ("c11E", "c12E", "c13E")}
    return {name: Size(one.re, one.u_re or 0.0, one.unit) for name, one in found.items() if one is not None}
