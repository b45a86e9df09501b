"""A learned law against the effects of the catalogue that imitate it."""

import numpy as np
from relaxing_disk import BUILD, recorded, relaxing

from pzctl.fitters.diagnosis.diagnose import diagnose
from pzctl.fitters.engine.parameters.assembly import stack_of


def test_a_law_takes_the_place_of_what_only_imitates_it() -> None:
    """Without a law, a resonance beside the lead is named, which leaves forty times as much."""
    f = np.linspace(1.5e6, 7.5e6, 301)
    Z = relaxing(stack_of(BUILD, BUILD.step("disk")), 0.2, 4e6, f)
    diagnosis = diagnose(recorded(Z, f), effects=("cable",), learn=True)
    assert [(one.effect, one.where) for one in diagnosis.findings] == [("learned", "layer:disk")]
    assert diagnosis.findings[0].probability > 0.9
    assert diagnosis.verdict == "explained"
    assert (diagnosis.places[0].where, diagnosis.places[0].quantity) == ("layer:disk", "permittivity")
