"""Candidates: every effect, of the catalogue or the user's own, at every place of a build where it can occur."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from ....models.base.face_loads import FACES
from ....models.base.model import Model
from ....models.effects import Device, Effect, EffectParameter
from ....models.effects.base.effect import SWEEP, TERMINALS, interfaces, is_bare_front
from ....models.stack import Stack
from ...engine.recording import recorded_band
from ...user_effects import every_effect
from ..decision_rules import SHARP
from .instrument_artefacts import ANY, FLAWS
from .problem import Candidate, Problem

_FLANK = 2 / SHARP
"""How far outside the band a sharp resonance is looked for, relative to its end: two widths of the broadest one. There
its flank is still curved; further away it is a capacitance or a stiffness."""


def candidates(problem: Problem, names: Iterable[str] | None = None) -> tuple[Candidate, ...]:
    """Return the candidates of all effects that are looked for unnamed, or of those in `names`.

    An effect in a layer, at an interface or on the back is present in every step that has that place. An effect at the
    terminals may be present in all steps, from one step onwards (another clip), or in one; an effect of the sweep in
    all steps or in one. The front of a step is buried by the next one, so it belongs to its step alone, unless the
    effect stays there: a mass on the disk's front is later one between the disk and what is glued to it.
    A model that is no stack can only have effects outside of it, those of its layers' laws if it has laws, and those on
    its faces if it has faces.
    """
    wanted = None if names is None else set(names)
    considered = [one for one in every_effect() if (not one.only_named if wanted is None else one.name in wanted)]
    return tuple(found for effect in considered for found in candidates_of(problem, effect))


def flaws(problem: Problem) -> tuple[Candidate, ...]:
    """Return the possible artefacts of the instrument as candidates."""
    return tuple(found for flaw in FLAWS for found in candidates_of(problem, flaw))


def candidates_of(problem: Problem, effect: Effect) -> list[Candidate]:
    """Return the candidates of one effect."""
    places: dict[str, list[str]] = {}
    devices = {recording.step: recording.model for recording in problem.recordings}
    stacks = [device.reference for device in devices.values() if isinstance(device, Device)]
    for step, device in devices.items():
        if isinstance(device, Device):
            for where in effect.looked_for_in(device.bare, device.reference):
                there = _covered(device.reference, stacks) if effect.stays and where == FACES[1] else None
                places.setdefault(there or where, []).append(step)
    found: list[Candidate] = []
    for where, steps in places.items():
        device = devices[steps[-1]]
        if not isinstance(device, Device):
            continue
        effect_parameters = effect.parameters_in(device.bare, device.reference, where)
        if not effect_parameters:
            continue
        beyond = _FLANK if any(knob.name == "q" and knob.upper > SHARP for knob in effect_parameters) else 0.0
        effect_parameters = tuple(_recorded(problem, knob, beyond) for knob in effect_parameters)
        known = {step: _known(devices[step], effect, where) for step in steps}
        open_steps = [step for step in steps if effect.several or not known[step]]
        if effect.from_later_step:
            groups = [tuple(open_steps[k:]) for k in range(1, len(open_steps))]
        else:
            groups = step_groups(where, open_steps) if open_steps else []
        found += [
            Candidate(effect.another(1 + max(known.values())), where, group, effect_parameters) for group in groups
        ]
    return found


def _covered(stack: Stack, stacks: Sequence[Stack]) -> str | None:
    """Return the interface that the front of a stack becomes in a later one of `stacks`; None if it stays free."""
    there = [where for other in stacks for where in interfaces(other) if is_bare_front(stack, where)]
    return there[0] if there else None


def _known(device: Model, effect: Effect, where: str) -> int:
    """Return how many of this effect the build states, which are therefore part of the device already."""
    added = device.added if isinstance(device, Device) else ()
    return sum((one.effect.law_name, one.where) == (effect.law_name, where) for one in added)


def step_groups(where: str, steps: Sequence[str]) -> list[tuple[str, ...]]:
    """Return the sets of steps in which an effect at this place may be present.

    What is inside of a device stays in it; the leads may have changed between two steps.
    """
    single = [(step,) for step in steps]
    if where == FACES[1]:
        return single
    if where == TERMINALS:
        later = [tuple(steps[k:]) for k in range(len(steps) - 1)]
        return [*later, *single]
    return [tuple(steps), *single] if where in (SWEEP, ANY) and len(steps) > 1 else [tuple(steps)]


def as_set(problem: Problem, knob: EffectParameter) -> EffectParameter:
    """Return a parameter with its value from the settings of the recordings, if it is one."""
    if not knob.setting:
        return knob
    said = (recording.sweep.settings.get(knob.setting) for recording in problem.recordings)
    known = next((float(value) for value in said if value is not None), knob.null)
    return replace(knob, null=float(np.clip(known, knob.lower, knob.upper)))


def _recorded(problem: Problem, knob: EffectParameter, beyond: float) -> EffectParameter:
    """Return a parameter with its value from the settings; a frequency is limited to the recorded band.

    `beyond`: how far it may lie outside, relative to the end of the band.
    """
    if knob.name != "frequency" or knob.unit != "Hz":
        return as_set(problem, knob)
    low, high = recorded_band(problem.recordings)
    null = float(np.clip(knob.null, 1.01 * low, 0.99 * high))
    return replace(knob, lower=low * (1 - beyond), upper=high * (1 + beyond), null=null)
