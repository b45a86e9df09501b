"""A learned law against the effects of the catalogue that imitate it."""

import numpy as np
from relaxing_disk import BUILD, recorded, relaxing, with_permittivity

from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.engine.parameters.assembly import stack_of


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
