"""What several steps share tells places apart; test_learning.py has what one step alone tells."""

from dataclasses import replace

import numpy as np

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.diagnosis.learning.drawn_corrections import PlacedCorrection
from pzctl.fitters.diagnosis.learning.places import placed_corrections
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.models.effects import Device
from pzctl.models.effects.learned.corrections import Place
from pzctl.models.effects.learned.learned import learned_law
from pzctl.models.stack import Stack
from pzctl.models.sweep import Sweep

WHOLE = read_build(THESIS_BUILD)
BUILD = replace(WHOLE, steps=WHOLE.steps[:2])
"""A disk, and the disk with a layer glued to it."""
F = np.linspace(1.5e6, 7.5e6, 31)
DISK, GLUED = (stack_of(BUILD, step) for step in BUILD.steps)


def _task(disk: np.ndarray, glued: np.ndarray) -> FitTask:
    random = np.random.default_rng(5)
    noise = 2e-4 * (random.normal(size=(2, F.size)) + 1j * random.normal(size=(2, F.size)))
    sweeps = {"disk": (Sweep(F, disk * np.exp(noise[0])),), "ml1": (Sweep(F, glued * np.exp(noise[1])),)}
    return FitTask(BUILD, sweeps)


def _likeliest(task: FitTask) -> PlacedCorrection:
    problem = Problem.of(solve(task, lambda _: None), None)
    return placed_corrections(problem, fitted(problem, (), problem.values))[0]


def _relaxing(place: Place, size: float) -> tuple[np.ndarray, np.ndarray]:
    law = learned_law(place, "debye", DISK)

    def recorded(stack: Stack) -> np.ndarray:
        there = place.where.removeprefix("layer:") in [layer.name for layer in stack.layers]
        device = Device(stack, nominal=DISK)
        return (device.with_effect(law, place.where, {"size": size, "at": 4e6}) if there else device).impedance(F)

    return recorded(DISK), recorded(GLUED)


def test_a_layer_is_told_by_the_steps_that_have_it() -> None:
    """Of the second step alone, the stiffness of the glue cannot be told from the disk's coupling."""
    place = Place("layer:glue1", "stiffness")
    found = _likeliest(_task(*_relaxing(place, 0.5)))
    assert (found.place, found.steps) == (place, ("ml1",))
    assert found.probability > 0.9
