"""Start values of an echo at a place: the delays at which the residual is periodic in frequency.

A smooth correction cannot follow an echo of a long delay, so its delay is looked for in the residual itself.
"""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ....models.base.arrays import Complexes, Frequencies
from ....models.effects import Device
from ....models.effects.base.effect import EffectParameter
from ....models.effects.learned.corrections import Place
from ....models.effects.learned.laws import Law
from ....models.effects.learned.learned import LearnedLaw
from ....models.stack import Stack
from ...error_model.error_columns import stack_of
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate
from ..search.echo_delays import LikelyDelay, likely_delays, longest_delay

_CONSTANT = Law(
    "constant",
    (EffectParameter("size", "1", 0.01),),
    lambda x, values: np.full(x.size, values["size"], np.complex128),
    "a constant part of {size}",
)
_LEAST, _MOST = 1e-3, 0.9
"""Limits of the start value of an echo, relative to natural size and largest value."""
_STEP = 1e-4
"""Correction by which a derivative is taken."""


def delays_at(
    parent: Hypothesis, place: Place, steps: tuple[str, ...], low: float, high: float
) -> tuple[LikelyDelay, ...]:
    """Return the likeliest delays between `low` and `high` of an echo at a place, most explained first.

    The echo of a medium that ends free: to first order its correction is -2 exp(-j w delay).
    """
    frequency, slope, J, r = linearised(parent, place, steps)
    longest = longest_delay([one.sweep.frequency for one in parent.objective.recordings if one.step in steps])
    return likely_delays(frequency, -slope, J, r, low, min(high, longest))


def echo_starts(effect: LearnedLaw, one: Candidate, parent: Hypothesis) -> list[dict[str, float]]:
    """Return an echo at each of the likeliest delays, with half of the size that explains most to first order."""
    knobs = {knob.name: knob for knob in one.effect_parameters}
    delay = knobs["delay"]
    made: list[dict[str, float]] = []
    for found in delays_at(parent, effect.place, one.steps, delay.lower, delay.upper):
        echo = {"echo": knobs["echo"].null} if "echo" in knobs else {}
        size = effect.natural * found.amplitude / (4 * echo.get("echo", 1.0))
        size = min(max(size, _LEAST * effect.natural), _MOST * knobs["size"].upper)
        made.append({one.prefix + name: value for name, value in ({"size": size, "delay": found.delay} | echo).items()})
    return made


def linearised(
    parent: Hypothesis, place: Place, steps: tuple[str, ...]
) -> tuple[Frequencies, Complexes, Complexes, Complexes]:
    """Return frequencies, d ln Z / d correction, derivatives by the coordinates, and ln(Z_model/Z), of valid points."""

    def constant(stack: Stack) -> Sequence[Probe]:
        effect = LearnedLaw(place, _CONSTANT, stack)
        return [(effect, {"size": _STEP * effect.natural})]

    frequency, changes, J, r = changed_by(parent, steps, constant)
    return frequency, np.asarray(changes[:, 0] / _STEP, np.complex128), J, r


Probe = tuple[LearnedLaw, Mapping[str, float]]
"""A law with its parameters."""


def changed_by(
    parent: Hypothesis, steps: tuple[str, ...], probes: Callable[[Stack], Sequence[Probe]]
) -> tuple[Frequencies, Complexes, Complexes, Complexes]:
    """Return frequencies, changes of ln Z by each probe, derivatives by the coordinates, and ln(Z_model/Z).

    Shapes (N,), (N, P), (N, M) and (N,), N the valid points of all recordings of these steps. `probes` are those of a
    stack.
    """
    objective, gram = parent.objective, parent.fit.gram
    models = objective.models(parent.fit.x)
    parts: list[tuple[Frequencies, Complexes, Complexes, Complexes]] = []
    for recording, model, J, r in zip(objective.recordings, models, gram.J, gram.r, strict=True):
        if recording.step not in steps or not isinstance(model, Device):
            continue
        f = recording.sweep.frequency
        Z = model.impedance(f)
        with_each = [
            model.with_effect(law, law.place.where, values).impedance(f) for law, values in probes(stack_of(model))
        ]
        changes = np.stack([np.log(own / Z) for own in with_each], axis=1)
        on = np.isfinite(recording.noise) & np.all(np.isfinite(changes), axis=1)
        parts.append((f[on], changes[on], J[on], r[on]))
    if not parts:
        none = np.zeros(0, np.complex128)
        return np.zeros(0), none.reshape(0, 1), none.reshape(0, 0), none
    return (
        np.concatenate([one[0] for one in parts]),
        np.concatenate([one[1] for one in parts]),
        np.concatenate([one[2] for one in parts]),
        np.concatenate([one[3] for one in parts]),
    )
