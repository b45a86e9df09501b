"""The whole device with a law: where it absorbs power, and where it would be a source."""

import pytest
from relaxing_disk import F, recorded

from pzctl.fitters.diagnosis.hypotheses.hypothesis import Hypothesis, fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate, Problem
from pzctl.fitters.diagnosis.validation.whole_device import whole_device
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.models.effects import Device, Effect, find_effect
from pzctl.models.effects.learned.corrections import Place
from pzctl.models.effects.learned.learned import learned_law


def _found(bare: Device, effect: Effect, where: str, values: dict[str, float]) -> Hypothesis:
    """Return the disk of the thesis with an effect of this size."""
    problem = Problem.of(solve(recorded(bare.bare.impedance(F)), lambda _: None), None)
    one = Candidate(effect, where, ("disk",), effect.effect_parameters(bare.bare, where))
    own = {one.prefix + name: value for name, value in values.items()}
    return fitted(problem, (one,), {**problem.values, **own}, near=True, rounds=0)


def test_a_device_with_a_passive_law_absorbs_power_ten_times_beyond_its_band(bare: Device) -> None:
    law = learned_law(Place("terminals", "series"), "resistance", bare.bare)
    found = whole_device(_found(bare, law, "terminals", {"resistance": 0.1}))
    assert not found.active
    assert (found.low, found.high) == pytest.approx((F[0] / 10, 10 * F[-1]))
    assert "absorbs power" in found.says


def test_a_device_that_would_be_a_source_below_its_band_is_told(bare: Device) -> None:
    """The loss of a piezoelectric constant that relaxes is more than those of stiffness and permittivity allow."""
    effect = find_effect("piezoelectric-dispersion")
    found = whole_device(_found(bare, effect, "layer:disk", {"relaxation": 0.1, "relaxation_frequency": 1.0}))
    ((step, low, high),) = found.active
    assert (step, low, high < F[0]) == ("disk", found.low, True)
    assert f"{low / 1e6:.3g} to {high / 1e6:.3g} MHz (disk)" in found.says
