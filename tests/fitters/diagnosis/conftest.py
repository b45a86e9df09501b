"""A disk with a lead that its build omits: recorded, searched and diagnosed once, in half a second."""

from dataclasses import dataclass

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.diagnosis.hypotheses.candidates import candidates
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate, Problem
from pzctl.fitters.diagnosis.search.greedy_search import GreedySearch
from pzctl.fitters.diagnosis.search.refit import Refit, as_refit
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.models.effects import Device, find_effect
from pzctl.models.sweep import Sweep

BUILD = read_build(THESIS_BUILD)
F = np.linspace(1.5e6, 7.5e6, 301)
NOISE = 2e-4
CONSIDERED = ("lead-inductance", "stray-capacitance", "electrode-mass", "leakage")


@dataclass(frozen=True)
class LeadCase:
    """The disk, its lead, and the problem of a search among four effects."""

    task: FitTask
    inductance: float
    """H."""
    stack: object
    problem: Problem
    candidates: tuple[Candidate, ...]
    search: GreedySearch

    @property
    def lead(self) -> Candidate:
        """The true effect."""
        return next(one for one in self.candidates if one.effect.name == "lead-inductance")

    @property
    def null(self) -> Refit:
        """The fit without effects, with noise as the only error."""
        return as_refit(self.problem, self.search.null)

    @property
    def final(self) -> Refit:
        """The best fit, with noise as the only error."""
        return as_refit(self.problem, self.search.best)


def recorded(device: Device, seed: int) -> FitTask:
    """Return the task of a sweep of the disk with the noise of a 4294A."""
    random = np.random.default_rng(seed)
    Z = device.impedance(F) * np.exp(NOISE * (random.normal(size=F.size) + 1j * random.normal(size=F.size)))
    return FitTask(BUILD, {"disk": (Sweep(F, Z),)})


@pytest.fixture(scope="session")
def bare() -> Device:
    """The thesis's disk without a missing effect."""
    return Device(stack_of(BUILD, BUILD.step("disk")))


@pytest.fixture(scope="session")
def nothing(bare: Device) -> FitTask:
    """Its recording."""
    return recorded(bare, 2)


@pytest.fixture(scope="session")
def lead_case(bare: Device) -> LeadCase:
    inductance = 1.2e-8
    device = bare.with_effect(find_effect("lead-inductance"), "terminals", {"inductance": inductance})
    task = recorded(device, 1)
    problem = Problem.of(solve(task, lambda _: None), None)
    choice = candidates(problem, CONSIDERED)
    search = GreedySearch(problem, choice)
    search.run()
    return LeadCase(task, inductance, bare.bare, problem, choice, search)
