"""Is it the finite diameter? The disk in two dimensions against the recordings that a plate without rim leaves.

Radial overtones and the edge mode are no small addition to the thickness mode: no extension of the one-dimensional
model is right to the noise. So the whole disk is fitted anew, all ten constants, by the fitter `disk2d`.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ....models.effects import find_effect
from ...disk.two_d.disk2d import finite_disk
from ...interface import Curve, FitError, FitResult, FitTask
from ..findings import Finding, Size
from ..search.refit import Refit
from ..validation.bands import guilty_bands

NAME = "lateral-modes"
_SHOWS = 0.02
"""Root mean square of ln(Z_model/Z) of the one-dimensional fit from which it is worth asking: lateral modes are not
faint. The best plate leaves 0.27, 0.11 and 0.035 at diameter/thickness 10, 20 and 40."""
_MOST, _NEARLY_ALL = 0.98, 0.999
"""Part of the misfit that the second dimension must take away where the disk is described, and where it is not quite:
ten free constants imitate much that is none of theirs."""
_DESCRIBED = 6e-3
"""Root mean square of ln(Z_model/Z) up to which the disk is described: its reduced model is hardly better."""
_SECONDS = 12.0
_PROBABILITY = 0.98


@dataclass(frozen=True, eq=False)
class FiniteDisk:
    """The bare disk's recordings as a disk of finite diameter describes them."""

    result: FitResult
    taken: float
    """Part of the misfit of these recordings that the second dimension takes away."""

    @property
    def described(self) -> bool:
        """Whether what is left is what the two-dimensional model itself is worth."""
        return self.result.rms_log_error < _DESCRIBED


def finite(task: FitTask, null: Refit, best: Refit, progress: Callable[[str], None]) -> FiniteDisk | None:
    """Return the disk in two dimensions where it explains the bare disk's recordings, else None.

    None too where there is no recording of a round bare disk, or one so wide that its rim does not matter, and where
    the `best` explanation in one dimension leaves so little that no lateral modes can be in it.
    """
    recordings = null.objective.recordings
    left = max(float(np.sqrt(np.mean(np.abs(ratio) ** 2))) for ratio in best.objective.log_ratios(best.descent.x))
    if left < _SHOWS:
        return None
    progress("fitting the disk in two dimensions")
    try:
        result = finite_disk(task, _SECONDS, enough=_DESCRIBED)
    except FitError:
        return None
    before = max(
        chi2
        for recording, chi2 in zip(recordings, null.chi2, strict=True)
        if recording.step in {curve.step for curve in result.curves}
    )
    taken = 1 - (result.chi2_per_dof - 1) / max(before - 1, 1e-9)
    found = FiniteDisk(result, taken)
    return found if taken > (_MOST if found.described else _NEARLY_ALL) else None


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
        probability=_PROBABILITY,
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
