"""Constants that are told are those at the resonance; fits begin where loads can come back."""

from dataclasses import replace

import numpy as np
import pytest

from pzctl.daemon.files.builds.build_file import THESIS_BUILD, read_build
from pzctl.fitters.engine.multi_step_fit import solve
from pzctl.fitters.error_model.at_resonance import at_resonance
from pzctl.fitters.error_model.error_sizes import USUAL
from pzctl.fitters.error_model.marginal import Marginal
from pzctl.fitters.error_model.marginal_estimate import marginal_estimate
from pzctl.fitters.error_model.marginal_fit import MarginalFit, fit
from pzctl.fitters.interface import FitTask
from pzctl.models.effects.base.scale import resonance
from pzctl.models.stack.loss_laws import PowerLoss
from pzctl.models.sweep import Sweep
from pzctl.sim.bench.sample import sample

DISK = sample(0).stack("disk")
BUILD = read_build(THESIS_BUILD)


def recorded(exponent: float) -> Sweep:
    """Return a sweep over three thickness modes of a disk whose loss is a power of frequency, noise 2e-4."""
    f = np.linspace(2e6, 16e6, 401)
    noise = np.random.default_rng(0).normal(size=(2, f.size))
    ceramic = replace(DISK.layers[0], c_law=PowerLoss(resonance(DISK), exponent))
    return Sweep(f, replace(DISK, layers=(ceramic,)).impedance(f) * np.exp(2e-4 * (noise[0] + 1j * noise[1])))


@pytest.mark.parametrize("exponent", [0.25, -0.25])
def test_a_loss_that_depends_on_frequency_is_told_as_it_is_at_the_resonance(exponent: float) -> None:
    """The mean over the band, which the overtones decide, was told with a hundredth of it as its uncertainty."""
    solution = solve(FitTask(BUILD, {"disk": (recorded(exponent),)}), lambda _: None)
    told = marginal_estimate(solution.judged, solution.descent.x)
    k = list(told.values).index("disk.c33D.im")
    u, true = float(np.sqrt(told.covariance[k, k])), DISK.layers[0].c33D.imag
    assert abs(told.found.values["disk.c33D.im"] / true - 1) > 0.05, "the mean"
    assert abs(told.values["disk.c33D.im"] - true) < 2.5 * u
    assert u < 0.05 * true


def test_a_load_that_least_squares_have_driven_to_nothing_comes_back() -> None:
    """Its coordinate was at minus 1e9, the prior at 1: the fit never left, and promised 1e19 nats."""
    solution = solve(FitTask(BUILD, {"disk": (recorded(0.0),)}), lambda _: None)
    objective, minimum = solution.judged, solution.descent.x
    free = objective.coordinates.free
    x = np.where([name in ("back.z", "front.z") for name in free], -1e9, minimum)
    found = fit(Marginal.of(objective), x, (USUAL,), rounds=2, compared=False)
    assert found.promised == 0
    assert found.log_evidence == pytest.approx(fit(Marginal.of(objective), minimum, (USUAL,)).log_evidence, abs=3)


def test_a_fit_that_describes_nothing_still_has_constants() -> None:
    """Errors that had turned a permittivity round ended the diagnosis of a film behind a long lead."""
    solution = solve(FitTask(BUILD, {"disk": (recorded(0.0),)}), lambda _: None)
    marginal = Marginal.of(solution.judged)
    found = fit(marginal, solution.descent.x, (USUAL,))
    usual = found.minimum.corrections
    assert usual is not None
    wild = replace(usual, relative={name: np.full(usual.log_f.size, -1.5 + 0j) for name in usual.relative})
    turned = MarginalFit.at(marginal, replace(found.minimum, corrections=wild))
    assert "disk.eps33S" in wild.relative
    assert at_resonance(turned).values == pytest.approx(turned.values, rel=1e-9)
