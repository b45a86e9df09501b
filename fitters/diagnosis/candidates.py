"""Every effect of the catalogue at every place of a build where it could sit."""

from collections.abc import Iterable

from ...models.effects import Device, Effect, catalogue
from ...models.effects.effect import FACES, SWEEP, TERMINALS
from .problem import Candidate, Problem


def candidates(problem: Problem, names: Iterable[str] | None = None) -> tuple[Candidate, ...]:
    """Return all candidates, of all effects or of those called `names`.

    What sits in a layer, at an interface or on the back is there in every step that has it. What sits at the terminals
    or in the sweep may be there in all steps or in one; the front of a step is inside the next one, so it is its own.
    """
    wanted = None if names is None else set(names)
    found: list[Candidate] = []
    for effect in catalogue():
        if wanted is None or effect.name in wanted:
            found += _of_effect(problem, effect)
    return tuple(found)


def _of_effect(problem: Problem, effect: Effect) -> list[Candidate]:
    places: dict[str, list[str]] = {}
    devices = {recording.step: recording.model for recording in problem.recordings}
    for step, device in devices.items():
        if isinstance(device, Device):
            for where in effect.places(device.bare):
                places.setdefault(where, []).append(step)
    found: list[Candidate] = []
    for where, steps in places.items():
        device = devices[steps[-1]]
        if not isinstance(device, Device):
            continue
        knobs = effect.knobs(device.bare, where)
        if not knobs:
            continue
        front = where == FACES[1]
        alone = front or (len(steps) > 1 and where in (SWEEP, TERMINALS))
        groups = [] if front else [tuple(steps)]
        groups += [(step,) for step in steps] if alone else []
        found += [Candidate(effect, where, group, knobs) for group in groups]
    return found
