"""Changes of the recordings by an effect."""

from ....models.base.arrays import Complexes
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
