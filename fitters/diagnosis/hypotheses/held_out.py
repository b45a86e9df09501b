"""Choice of held-out data for validation: made before any fit, and never single points."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ....models.base.true_runs import true_runs
from ....models.effects import Device
from ....models.effects.base.scale import resonance
from ....models.sweep import Sweep
from ...engine.recording import Recording
from ...interface import FitError
from ..findings import Bands

BANDS, REPEATS, OVERTONES, STEPS = "bands", "repeats", "overtones", "steps"
KINDS = BANDS, REPEATS, OVERTONES, STEPS
_BLOCKS = 11
_OUT = (3, 7)
"""The two held-out blocks of eleven in every sweep; neighbours of random points would reveal them."""
_BETWEEN = 2.0
"""Frequency, in half-wave resonances of the bare disk, above which everything counts as overtones."""
_NONE = {
    REPEATS: "every step has one recording; give a step twice, disk=first.csv disk=second.csv",
    OVERTONES: "no recording goes above twice the first thickness resonance",
    STEPS: "no step was recorded after another",
}
"""Reason if there is nothing to hold out, by kind."""

Masks = tuple[NDArray[np.bool_], ...]


def held_out(recordings: Sequence[Recording], what: str) -> Masks:
    """Return the held-out points of every recording as masks, each of shape (N,).

    `what` is `bands` (two contiguous blocks of every sweep), `repeats` (all but the first recording of every step),
    `overtones` (everything above twice the half-wave resonance) or `steps` (the last step but one, whose layers are all
    part of the last step). Raises FitError for another word, and if nothing or everything would be held out.
    """
    if what not in KINDS:
        raise FitError(f"held out can be {', '.join(KINDS[:-1])} or {KINDS[-1]}, not {what}")
    if what == BANDS:
        return tuple(blocks(recording.sweep) for recording in recordings)
    steps = [recording.step for recording in recordings]
    if what == REPEATS:
        masks = tuple(np.full(one.sweep.frequency.size, one.step in steps[:k]) for k, one in enumerate(recordings))
    elif what == STEPS:
        before_the_last = [*dict.fromkeys(steps)][-2:-1]
        masks = tuple(np.full(one.sweep.frequency.size, one.step in before_the_last) for one in recordings)
    else:
        masks = tuple(_above(recording) for recording in recordings)
    if not any(mask.any() for mask in masks):
        raise FitError(f"there are no {what} to hold out: {_NONE[what]}")
    if all(mask.all() for mask in masks):
        raise FitError(f"without {what} nothing is left to fit: record the first thickness resonance as well")
    return masks


def bands_of(recording: Recording, mask: NDArray[np.bool_]) -> Bands:
    """Return the held-out bands in Hz, from the first to the last point of each."""
    f = recording.sweep.frequency
    return tuple((float(f[a]), float(f[b - 1])) for a, b in true_runs(mask))


def blocks(sweep: Sweep) -> NDArray[np.bool_]:
    """Return the points in the two held-out blocks of a sweep as a mask, shape (N,)."""
    block = (np.arange(sweep.frequency.size) * _BLOCKS) // sweep.frequency.size
    return np.isin(block, _OUT)


def _above(recording: Recording) -> NDArray[np.bool_]:
    model, f = recording.model, recording.sweep.frequency
    if not isinstance(model, Device):
        return np.zeros(f.size, np.bool_)
    return f > _BETWEEN * resonance(model.reference)
