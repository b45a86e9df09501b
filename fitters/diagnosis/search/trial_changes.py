"""Trial changes of the recordings by an effect: at a few plausible sizes, without fitting it."""

from collections.abc import Callable, Mapping, Sequence
from itertools import product

import numpy as np

from ....models.base.arrays import Complexes, Reals
from ....models.base.model import Model
from ....models.effects import Device, EffectParameter
from ...engine.recording import recorded_band
from ...error_model.local_error_kinds import WeakLine
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem
from .echo_delays import likely_delays, longest_delay
from .weak_lines import strongest_lines

_SPREADS = (-3.5, -2.0, -1.0, 0.0, 1.0)
"""Trial sizes, in standard deviations of ln size."""
_SIGNED = (-0.5, -0.1, -0.02, 0.02, 0.1, 0.5)
_LINES = 100
"""Number of trial frequencies of a further resonance."""
_SCANS = 160
_STRONGEST = 3
"""Number of lines of the residual at which a sharp resonance is tried."""
_SMALL = 1e-2
"""Amplitude of an echo, relative to the usual one, from which its change of ln Z is taken to first order."""


def lines_for(parent: Hypothesis, candidates: Sequence[Candidate]) -> dict[str, list[WeakLine]]:
    """Return the strongest lines of the residual in each step in which a sharp resonance may first appear."""
    steps = dict.fromkeys(one.step for one in candidates if one.resonates)
    return {step: strongest_lines(parent, step, _STRONGEST) for step in steps}


def changes_beside(
    problem: Problem, parent: Hypothesis, one: Candidate, lines: Sequence[WeakLine]
) -> list[tuple[dict[str, float], list[Complexes]]]:
    """Return the trial parameters of an effect beside a hypothesis, and the change of ln Z in every recording."""
    return trial_changes(problem, parent, one, lines, changer(problem, parent.effects, parent.values, one))


def trial_changes(
    problem: Problem,
    parent: Hypothesis,
    one: Candidate,
    lines: Sequence[WeakLine],
    change: Callable[[Mapping[str, float]], list[Complexes]],
) -> list[tuple[dict[str, float], list[Complexes]]]:
    """Return the same for another `change`; lines and delays are those that the residual of `parent` shows."""
    delays = _delays(parent, one, change)
    made: list[tuple[dict[str, float], list[Complexes]]] = []
    for effect_parameters in _trials(problem, one, lines, delays):
        values = {one.prefix + name: value for name, value in effect_parameters.items()}
        changed = change(values)
        if is_finite(changed):
            made.append((values, changed))
    return made


def changer(
    problem: Problem, effects: Sequence[Candidate], at: Mapping[str, float], one: Candidate
) -> Callable[[Mapping[str, float]], list[Complexes]]:
    """Return the function from an effect's parameters to its change of ln Z in every recording.

    `effects`: beside these; `at`: for these values of all other parameters.
    """
    with_one = problem.with_effects([*effects, one])
    models: list[Model] = []
    for recording in with_one:
        model = recording.model
        renamed = {recording.renamed.get(name, name): name for name in model.parameters()}
        models.append(model.replace({own: at[name] for name, own in renamed.items() if name in at}))
    sweeps = [recording.sweep.frequency for recording in with_one]
    devices = {
        k: model
        for k, (recording, model) in enumerate(zip(with_one, models, strict=True))
        if recording.step in one.steps and isinstance(model, Device)
    }

    def change(values: Mapping[str, float]) -> list[Complexes]:
        return [
            devices[k].log_ratio(devices[k].replace(values), f) if k in devices else np.zeros(f.size, np.complex128)
            for k, f in enumerate(sweeps)
        ]

    return change


def _delays(
    parent: Hypothesis, one: Candidate, change: Callable[[Mapping[str, float]], list[Complexes]]
) -> tuple[float, ...]:
    """Return the delays of an echo that the residual shows, if the effect is one."""
    knob = next((knob for knob in one.effect_parameters if knob.delay), None)
    if knob is None:
        return ()
    amplitude = one.effect_parameters[0]
    size = _SMALL * amplitude.expected[0]
    values = {name: own.null for name, own in zip(one.parameters, one.effect_parameters, strict=True)}
    changed = change({**values, one.prefix + amplitude.name: size})
    parts: list[tuple[Reals, Complexes, Complexes, Complexes]] = []
    made = parent.fit.gram
    for recording, own, J, r in zip(parent.objective.recordings, changed, made.J, made.r, strict=True):
        f = recording.sweep.frequency
        slope = own / size * np.exp(2j * np.pi * f * knob.null)
        on = np.isfinite(recording.noise) & np.isfinite(slope) & (recording.step in one.steps)
        parts.append((f[on], slope[on], J[on], r[on]))
    found = likely_delays(
        np.concatenate([one[0] for one in parts]),
        np.concatenate([one[1] for one in parts]),
        np.concatenate([one[2] for one in parts]),
        np.concatenate([one[3] for one in parts]),
        knob.lower,
        min(knob.upper, longest_delay([one[0] for one in parts])),
    )
    return tuple(one.delay for one in found)


def _trials(
    problem: Problem, one: Candidate, lines: Sequence[WeakLine], delays: tuple[float, ...]
) -> list[dict[str, float]]:
    sizes, others = one.effect_parameters[: one.effect.sizes], one.effect_parameters[one.effect.sizes :]
    if one.resonates:
        rest = _at_lines(lines, one, {knob.name: knob.null for knob in others})
    else:
        grids = [delays if knob.delay and delays else _scan(problem, knob) for knob in others]
        rest = [dict(zip((k.name for k in others), values, strict=True)) for values in product(*grids)]
    far = len(rest) > 1 or one.resonates
    made: list[dict[str, float]] = []
    for knob in sizes:
        small = [own for own in sizes if own is not knob]
        besides = [
            dict(zip((own.name for own in small), values, strict=True)) for values in product(*map(_while_small, small))
        ]
        centre, spread = knob.expected
        steps = (_SPREADS if not far else (-1.0,)) if knob.from_nothing else _SIGNED
        for z in steps:
            value = centre * np.exp(spread * z) if knob.from_nothing else centre + spread * z
            value = float(np.clip(value, knob.lower, 0.5 * knob.upper if np.isfinite(knob.upper) else knob.upper))
            made += [{**beside, **other, knob.name: value} for beside in besides for other in rest]
    return made[:: max(1, len(made) // _SCANS)]


def _while_small(knob: EffectParameter) -> tuple[float, ...]:
    """Return the values that a size has while another size of the effect is tried."""
    return knob.scan or (1e-4 * knob.expected[0] if knob.from_nothing else knob.null,)


def _at_lines(lines: Sequence[WeakLine], one: Candidate, others: dict[str, float]) -> list[dict[str, float]]:
    """Return the values of a sharp resonance's parameters that are no sizes, for each of these lines."""
    frequency = one.resonance_parameters[0].removeprefix(one.prefix)
    return [{**others, frequency: line.frequency, "q": line.q} for line in lines]


def _scan(problem: Problem, knob: EffectParameter) -> tuple[float, ...]:
    if knob.scan:
        return knob.scan
    if knob.unit == "Hz":
        low, high = recorded_band(problem.recordings)
        return tuple(np.geomspace(low, high, _LINES + 2)[1:-1].tolist())
    return (knob.expected[0] if knob.from_nothing else knob.null,)


def stretched(one: Candidate, values: dict[str, float], stretch: float) -> dict[str, float]:
    """Return the trial values with sizes scaled to the best fit."""
    sizes = {name: knob for name, knob in one.sizes if name in values}
    return {
        name: float(np.clip(knob.null + stretch * (value - knob.null), knob.lower, knob.upper))
        if (knob := sizes.get(name)) is not None
        else value
        for name, value in values.items()
    }


def is_finite(changed: Sequence[Complexes]) -> bool:
    """Return whether a change is a number at every point of every recording."""
    return all(np.all(np.isfinite(own)) for own in changed)
