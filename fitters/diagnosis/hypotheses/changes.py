"""Changes of the recordings by an effect, and the part of them that the constants cannot imitate."""

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.effects import Device
from ...engine.recording import log_ratio
from .hypothesis import Hypothesis
from .problem import Candidate, Problem


def change_by(problem: Problem, one: Hypothesis, effect: Candidate) -> list[Complexes]:
    """Return ln(Z with / Z without the effect), everything else unchanged, for each recording; shape (N,)."""
    without = [other for other in one.effects if other is not effect]
    curves = one.objective.curves(one.fit.x)
    made: list[Complexes] = []
    for recording, Z in zip(problem.with_effects(without), curves, strict=True):
        model = recording.model
        there = {recording.renamed.get(name, name): name for name in model.parameters()}
        bare = model.replace({own: one.values[n] for n, own in there.items() if n in one.values})
        made.append(log_ratio(Z, bare.impedance(recording.sweep.frequency)) if isinstance(bare, Device) else 0 * Z)
    return made


def projected(one: Hypothesis, changes: list[list[Complexes]]) -> Reals:
    """Return changes of ln Z after projecting out the constants, as columns of shape (2N, K)."""
    free = one.objective.coordinates.free
    effect_parameters = {name for effect in one.effects for name in effect.parameters}
    own = [k for k, name in enumerate(free) if name not in effect_parameters]
    slopes = np.concatenate(one.fit.gram.J)[:, own]
    rows = np.concatenate([slopes.real, slopes.imag])
    size = np.linalg.norm(rows, axis=0)
    Q, _ = np.linalg.qr(rows[:, size > 0] / size[size > 0])
    whole = np.stack([np.concatenate(change) for change in changes], axis=1)
    both = np.concatenate([whole.real, whole.imag])
    return both - Q @ (Q.T @ both)
