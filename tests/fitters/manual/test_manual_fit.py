"""A manual fit: the curve at chosen values, then a fit with exactly these choices."""

import re
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitError, FitTask
from pzctl.fitters.layered.mason import Mason
from pzctl.fitters.manual.manual_fit import Choices, ManualFit
from pzctl.models.build import Build, EffectSpec, Quantity
from pzctl.models.effects import Device, find_effect
from pzctl.models.sweep import Sweep

LEAD = ("lead-inductance", "terminals")
FREQUENCY = np.linspace(1e6, 15e6, 401)


@pytest.fixture
def build(disk_build: Callable[..., Build]) -> Build:
    return disk_build("Pz27", (16.0, 0.5, 7700.0))


@pytest.fixture
def task(build: Build, swept: Callable[..., Sweep]) -> FitTask:
    """A disk measured through 20 nH of lead."""
    device = Device(stack_of(build, build.steps[0])).with_effect(find_effect(LEAD[0]), LEAD[1], {"inductance": 2e-8})
    return FitTask(build, {"disk": (swept(device, FREQUENCY),)})


def test_the_curve_is_the_model_at_the_chosen_values(task: FitTask, build: Build) -> None:
    hand = ManualFit(task)
    (curve,) = hand.look(Choices(values={"disk.thickness": 0.52e-3})).curves
    stack = stack_of(build, build.steps[0]).replace({"disk.thickness": 0.52e-3})
    np.testing.assert_allclose(curve.fitted, stack.impedance(FREQUENCY), rtol=1e-6)


def test_only_free_constants_move_starting_from_the_chosen_values(task: FitTask) -> None:
    hand = ManualFit(task)
    result, there = hand.fit(Choices(free=("disk.c33D",), values={"disk.h33": 1.9e9, "disk.c33D.loss": 0.02}))
    assert there.values["disk.h33"] == pytest.approx(1.9e9, rel=1e-9)
    assert there.values["disk.c33D.loss"] == pytest.approx(0.02, rel=1e-9)
    assert result.constants["disk.c33D"].u_re
    assert result.constants["disk.h33"].u_re == 0
    assert hand.look(there).chi2_per_dof == pytest.approx(result.chi2_per_dof, rel=0.01)


def test_the_slider_of_a_law_of_the_build_has_its_unit_and_moves_the_curve(task: FitTask, build: Build) -> None:
    """As large on the slider as it may become: twice its value, or what is large in such a device."""
    law = EffectSpec(
        "learned",
        "terminals",
        values={"size": Quantity(3.0, u=0.1), "size_2": Quantity(0.5, u=0.01)},
        quantity="series",
        law="resistance+inertance",
    )
    hand = ManualFit(replace(task, build=replace(build, effects=(law,))))
    size = next(one for one in hand.look().handles if one.name == "learned@terminals.size")
    assert (size.value, size.unit, size.low) == (pytest.approx(3.0), "ohm", 0.0)
    assert size.high >= 6.0
    before, after = (hand.look(Choices(values={size.name: ohm})).curves[0].fitted for ohm in (3.0, 5.0))
    np.testing.assert_allclose(after - before, 2.0, rtol=1e-6)


def test_what_no_diagnosis_looks_for_unnamed_can_be_chosen_by_hand(task: FitTask) -> None:
    assert ManualFit(task).places()["fixture-residual"] == ("terminals",)
    result, _ = ManualFit(task).fit(Choices(effects=(("fixture-residual", "terminals"),)))
    assert result.constants["fixture-residual@terminals.inductance"].re == pytest.approx(2e-8, rel=0.02)


def test_an_effect_chosen_by_hand_is_fitted_with_its_size(task: FitTask) -> None:
    hand = ManualFit.after(task, Mason().fit(task))
    assert hand.look().chi2_per_dof > 5, "without the lead the disk is not described"
    result, there = hand.fit(Choices(effects=(LEAD,)))
    lead = result.constants["lead-inductance@terminals.inductance"]
    assert result.chi2_per_dof == pytest.approx(1.0, abs=0.2)
    assert abs(lead.re - 2e-8) < 4 * (lead.u_re or 0.0) + 1e-12
    assert hand.look(there).chi2_per_dof == pytest.approx(result.chi2_per_dof, rel=0.05)


def test_only_the_chosen_band_is_fitted(task: FitTask) -> None:
    (sweep,) = task.sweeps["disk"]
    spoiled = sweep.impedance * np.where(sweep.frequency > 8e6, 1.5, 1.0)
    hand = ManualFit(replace(task, sweeps={"disk": (replace(sweep, impedance=spoiled),)}))
    band = Choices(bands={"disk": ((1e6, 8e6),)}, effects=(LEAD,))
    result, _ = hand.fit(band)
    assert result.chi2_per_dof == pytest.approx(1.0, abs=0.25)
    assert result.curves[0].frequency.size == FREQUENCY.size, "the curve is shown over the whole sweep"


@pytest.mark.parametrize(
    ("choices", "sentence"),
    [
        (Choices(free=("disk.c33",)), "cannot free 'disk.c33': there are area"),
        (Choices(free=()), "nothing is free"),
        (Choices(values={"disk.colour": 1.0}), "'disk.colour' cannot be moved: there are area"),
        (Choices(values={"disk.thickness": -1.0}), "'disk.thickness' cannot be -1: a positive number"),
        (Choices(bands={"ml1": ()}), "bands of step 'ml1': it was not recorded; disk was"),
        (Choices(bands={"disk": ((2e6, 1e6),)}), "band 2 to 1 MHz of step 'disk'"),
        (Choices(bands={"disk": ((2e6, 2.1e6),)}), "no band holds 20 points"),
        (Choices(effects=(("cable", "layer:disk"),)), "'cable' cannot be at 'layer:disk'; possible places: terminals"),
        (Choices(effects=(LEAD, LEAD)), "effect 'lead-inductance' at 'terminals' is chosen twice"),
        (Choices(values={"disk.thickness": 1e-300}), "the model's |Z| is not from 1e-30 to 1e+30 ohm"),
        (Choices(effects=(("sweep-lag", "sweep"),), bands={"disk": ((1e6, 8e6),)}), "needs the whole sweep"),
    ],
)
def test_what_cannot_be_is_a_sentence(task: FitTask, choices: Choices, sentence: str) -> None:
    with pytest.raises(FitError, match=re.escape(sentence)):
        ManualFit(task).fit(choices)
