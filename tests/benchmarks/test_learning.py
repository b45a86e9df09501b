"""Learned laws: against effects of the catalogue that imitate them, two at one place, and from several steps."""

from dataclasses import replace

import numpy as np
from relaxing_disk import BUILD, recorded, relaxing, with_permittivity

from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Problem
from pzctl.fitters.diagnosis.learning.places import placed_corrections
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitTask
from pzctl.models.effects.learned.corrections import Place


def test_three_resonances_of_a_permittivity_are_learned_as_one_law() -> None:
    """None of them alone explains enough to tell its place."""
    f = np.linspace(1.5e6, 7.5e6, 201)
    lines = ((2.4e6, 0.002), (3.55e6, 0.003), (5.75e6, 0.002))

    def change(at: float) -> complex:
        return sum(size / (1 - (at / own) ** 2 + 1j * at / own / 60) for own, size in lines)

    stack = stack_of(BUILD, BUILD.step("disk"))
    diagnosis = diagnose(recorded(with_permittivity(stack, change, f), f), effects=("polarity",), learn=True)
    (finding,) = diagnosis.findings
    assert (diagnosis.verdict, finding.effect, finding.where) == ("explained", "learned", "layer:disk")
    found = sorted(finding.parameters[name].value for name in ("at", "at_2", "at_3"))
    np.testing.assert_allclose(found, [at for at, _ in lines], rtol=1e-3)
    assert diagnosis.effects[0].quantity == diagnosis.places[0].quantity == "permittivity"


def test_a_law_takes_the_place_of_what_only_imitates_it() -> None:
    """Without a law, a resonance beside the lead is named, which leaves forty times as much."""
    f = np.linspace(1.5e6, 7.5e6, 301)
    Z = relaxing(stack_of(BUILD, BUILD.step("disk")), 0.2, 4e6, f)
    diagnosis = diagnose(recorded(Z, f), effects=("cable",), learn=True)
    assert [(one.effect, one.where) for one in diagnosis.findings] == [("learned", "layer:disk")]
    assert diagnosis.findings[0].probability > 0.9
    assert diagnosis.verdict == "explained"
    assert (diagnosis.places[0].where, diagnosis.places[0].quantity) == ("layer:disk", "permittivity")


def test_two_laws_at_one_place_are_learned_one_after_the_other() -> None:
    """A conductance across a contact. First the contact is learned, beside a fault of the phase; then its cause."""
    f = np.linspace(1.5e6, 7.5e6, 61)
    Z = stack_of(BUILD, BUILD.step("disk")).impedance(f) + 4.0
    diagnosis = diagnose(recorded(1 / (1 / Z + 4e-3), f), effects=("polarity",), learn=True)
    assert diagnosis.verdict == "explained"
    laws = [(one.where, one.quantity, one.law) for one in diagnosis.effects]
    assert laws == [("terminals", "series", "resistance"), ("terminals", "shunt", "resistance")]


def test_a_lead_of_one_step_is_learned_for_this_step() -> None:
    f, build = np.linspace(1.5e6, 7.5e6, 61), replace(BUILD, steps=BUILD.steps[:2])
    disk, glued = (stack_of(build, step).impedance(f) for step in build.steps)
    (first,) = recorded(disk, f).sweeps["disk"]
    (second,) = recorded(glued + 0.5 * np.sqrt(2j * np.pi * f / 2.6e7), f).sweeps["disk"]
    task = FitTask(build, {"disk": (first,), "ml1": (second,)})
    diagnosis = diagnose(task, effects=("polarity",), learn=True)
    (law,) = diagnosis.effects
    assert (law.where, law.quantity, law.law, law.steps) == ("terminals", "series", "root", ("ml1",))
    assert (diagnosis.places[0].where, diagnosis.places[0].step) == ("terminals", "ml1")
    assert "series with the device in ml1" in diagnosis.places[0].says


def test_an_instrument_that_is_wrong_for_every_device_has_no_law() -> None:
    """Of the disk alone, a permittivity that relaxes would be learned and written to its build."""
    f, build = np.linspace(1.5e6, 7.5e6, 61), replace(BUILD, steps=BUILD.steps[:2])
    disk, glued = (stack_of(build, step).impedance(f) * (1 + 0.1 / (1 + 1j * f / 4e6)) for step in build.steps)
    (first,), (second,) = recorded(disk, f).sweeps["disk"], recorded(glued, f).sweeps["disk"]
    diagnosis = diagnose(FitTask(build, {"disk": (first,), "ml1": (second,)}), effects=("polarity",), learn=True)
    assert diagnosis.verdict in ("unexplained", "partly-explained")
    assert diagnosis.effects == ()
    assert (diagnosis.places[0].where, diagnosis.places[0].quantity) == ("instrument", "reading")
    assert diagnosis.places[0].probability > 0.9


def test_of_the_disk_alone_a_gain_that_falls_is_a_permittivity_that_relaxes() -> None:
    """By 3 %; with the glued disk beside it, it is the instrument (test_learning_from_steps.py)."""
    f = np.linspace(1.5e6, 7.5e6, 41)
    Z = stack_of(BUILD, BUILD.step("disk")).impedance(f) * (1 + 0.03 / (1 + 1j * f / 4e6))
    problem = Problem.of(solve(recorded(Z, f), lambda _: None), None)
    likeliest = placed_corrections(problem, fitted(problem, (), problem.values))[0]
    assert likeliest.place == Place("layer:disk", "permittivity")
