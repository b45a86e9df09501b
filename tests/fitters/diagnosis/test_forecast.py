"""The forecast of held-out data: right for a right law, failed where the law does not hold there."""

import numpy as np
import pytest
from relaxing_disk import F, recorded

from pzctl.fitters.diagnosis.hypotheses.hypothesis import fitted
from pzctl.fitters.diagnosis.hypotheses.problem import Candidate, Problem
from pzctl.fitters.diagnosis.validation.forecast import Forecast, forecast_of
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.models.effects import Device
from pzctl.models.effects.learned.corrections import Place
from pzctl.models.effects.learned.learned import learned_law

_LEAD, _HELD_OUT = 2j * np.pi * F * 2e-8, 3.4e6
"""A lead, and a frequency in the first held-out block."""


def _forecast(bare: Device, Z: np.ndarray) -> Forecast:
    problem = Problem.of(solve(recorded(Z), lambda _: None), None)
    place = Place("terminals", "series")
    law = learned_law(place, "inertance", bare.bare)
    one = Candidate(law, place.where, ("disk",), law.effect_parameters(bare.bare, place.where))
    found = forecast_of(problem, fitted(problem, (one,), problem.values))
    assert found is not None
    return found


def test_a_right_law_predicts_held_out_data_to_the_noise(bare: Device) -> None:
    forecast = _forecast(bare, bare.bare.impedance(F) + _LEAD)
    assert forecast.chi2_per_dof == pytest.approx(1, abs=4 * np.sqrt(2 / 54))
    assert not forecast.failed


def test_a_law_that_is_right_elsewhere_fails_where_the_held_out_data_differ(bare: Device) -> None:
    """Errors that would describe these as well are larger than all other data allow."""
    bump = 1 + 0.01 * np.exp(-(((F - _HELD_OUT) / 1e5) ** 2))
    forecast = _forecast(bare, (bare.bare.impedance(F) + _LEAD) * bump)
    assert forecast.failed
    assert forecast.chi2_per_dof > 10
