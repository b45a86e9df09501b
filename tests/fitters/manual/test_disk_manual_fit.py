"""A manual fit of a bare disk with the models of `radial` and `disk`."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from pzctl.fitters.disk.disk_fitter import DiskFitter
from pzctl.fitters.disk.radial import RadialLeastSquares
from pzctl.fitters.engine.parameters.assembly import stack_of
from pzctl.fitters.interface import FitError, FitTask
from pzctl.fitters.manual.manual_fit import Choices, ManualFit, models_for
from pzctl.models.build import Build
from pzctl.models.constants.piezo_constants import Radial
from pzctl.models.disk.round_disk import BothModes, RadialDisk
from pzctl.models.effects import Device, find_effect, outside_effects
from pzctl.models.effects.base.device import Added
from pzctl.models.stack import CausalConstantQ
from pzctl.models.sweep import Sweep

FIRST, THICKNESS = 124.75e3, 4.22e6
BANDS = (np.arange(80e3, 600e3, 1.3e3), np.linspace(2e6, 9e6, 401))
STRAY = ("stray-capacitance", "terminals")
FITTERS = {"radial": RadialLeastSquares(), "disk": DiskFitter()}


@pytest.fixture
def build(disk_build: Callable[..., Build]) -> Build:
    return disk_build("test ceramic", (16.0, 0.512, 7700.0), (0.0, 0.0, 0.0))


@pytest.fixture
def device(build: Build) -> BothModes:
    v = build.layer("disk").values
    radial = Radial(*(v[name].value for name in ("s11E", "s12E", "d31", "eps33T")))
    stack = stack_of(build, build.steps[0])
    law = CausalConstantQ(THICKNESS)
    disk = BothModes.of(
        replace(stack, layers=(replace(stack.layers[0], c_law=law, h_law=law, eps_law=law),)), "disk", radial
    )
    laws = dict.fromkeys(("s11E", "s12E", "d31"), CausalConstantQ(FIRST))
    return replace(disk, arm=replace(disk.arm, alpha=0.69, d33f=1.35e-10, laws=laws))


@pytest.fixture
def thin(build: Build, device: BothModes) -> RadialDisk:
    """The same disk in the constants of `radial`."""
    made = RadialDisk.of("disk", device.radial, build.area.re, 0.512e-3, 7700.0)
    law = CausalConstantQ(FIRST)
    arm = replace(made.arm, alpha=0.69, d33f=1.35e-10, laws=device.arm.laws)
    return replace(made, arm=arm, eps_law=law)


@pytest.fixture
def task(build: Build, device: BothModes, thin: RadialDisk, fitter: str, swept: Callable[..., Sweep]) -> FitTask:
    """Both bands, the first of them twice: a manual fit keeps repeats separate, while a fitter averages them."""
    model = thin if fitter == "radial" else device
    sweeps = [swept(model, band, 2e-4, seed=k) for k, band in enumerate((BANDS[0], *BANDS))]
    return FitTask(build, {"disk": tuple(sweeps)})


@pytest.mark.parametrize("fitter", FITTERS)
def test_a_manual_fit_starts_at_the_fits_result_and_a_slider_moves_the_curve(task: FitTask, fitter: str) -> None:
    result = FITTERS[fitter].fit(task)
    hand = ManualFit.after(task, result)
    look = hand.look()
    assert hand.fitter == fitter
    assert look.chi2_per_dof == pytest.approx(1.0, abs=0.15)
    assert [curve.frequency.size for curve in look.curves] == [band.size for band in (BANDS[0], *BANDS)]
    found = {handle.name: handle for handle in look.handles}
    assert found["disk.s12E"].value == pytest.approx(result.constants["disk.s12E"].re, rel=1e-6)
    assert found["disk.s11E"].unit == "1/Pa"
    assert found["disk.s11E.loss"].value == pytest.approx(0.0125, rel=0.5), "a compliance is s (1 - j loss)"
    moved = hand.look(Choices(values={"disk.s12E": 1.03 * found["disk.s12E"].value}))
    assert moved.chi2_per_dof > 100
    first = [look.curves[0].fitted, moved.curves[0].fitted]
    assert np.max(np.abs(np.log(first[1] / first[0]))) > 0.1


@pytest.mark.parametrize("fitter", FITTERS)
def test_held_constants_stay_exact_and_free_ones_recover(task: FitTask, fitter: str) -> None:
    hand = ManualFit.after(task, FITTERS[fitter].fit(task))
    there = {handle.name: handle.value for handle in hand.look().handles}
    off = {"disk.s11E": 1.01 * there["disk.s11E"], "disk.d31": 0.97 * there["disk.d31"]}
    result, after = hand.fit(Choices(free=tuple(off), values=off))
    assert {name: after.values[name] for name in there if name not in off} == pytest.approx(
        {name: value for name, value in there.items() if name not in off}, rel=1e-9
    )
    assert {name: after.values[name] for name in off} == pytest.approx({n: there[n] for n in off}, rel=1e-3)
    assert result.constants["disk.s11E"].u_re
    assert result.constants["disk.s12E"].u_re == result.constants["disk.s12E"].u_im == 0


@pytest.mark.parametrize("fitter", ["radial"])
def test_with_the_usual_constants_free_it_equals_the_fitters_fit(task: FitTask) -> None:
    own = RadialLeastSquares().fit(task)
    result, _ = ManualFit(task, "radial").fit()
    for name in ("disk.s11E", "disk.s12E", "disk.d31", "disk.eps33T"):
        mine, theirs = result.constants[name], own.constants[name]
        assert abs(mine.re - theirs.re) < 0.2 * (theirs.u_re or 0.0), name
        assert mine.u_re == pytest.approx(theirs.u_re, rel=0.2), name
    assert result.fitter == "by-hand"
    assert set(own.derived) == set(result.derived)


@pytest.mark.parametrize("fitter", FITTERS)
def test_an_effect_at_the_terminals_is_found_with_its_size(
    build: Build, device: BothModes, thin: RadialDisk, swept: Callable[..., Sweep], fitter: str
) -> None:
    model, held = (thin, "disk.eps33T") if fitter == "radial" else (device, "disk.eps33S")
    stray = Added(find_effect(STRAY[0]), STRAY[1], {"capacitance": 3e-11, "loss": 0.0})
    behind = Device(model, (stray,), nominal=stack_of(build, build.steps[0]))
    sweeps = tuple(swept(behind, band, 2e-4, seed=k) for k, band in enumerate(BANDS))
    hand = ManualFit(FitTask(build, {"disk": sweeps}), fitter)
    assert "lead-inductance" in hand.places()
    assert "electrode-mass" not in hand.places(), "which needs a stack to act in"
    name = "stray-capacitance@terminals.capacitance"
    free = (*(h.name for h in hand.look().handles if h.free and h.name not in (held, "area")), name)
    values = {held: model.parameters()[f"{held}.re"]}
    result, there = hand.fit(Choices(free, values, effects=(STRAY,)))
    assert result.chi2_per_dof == pytest.approx(1.0, abs=0.2)
    stray_u = result.constants[name].u_re or 0.0
    assert abs(there.values[name] - 3e-11) < 4 * stray_u < 1e-11
    assert result.constants[name].unit == "F"


def test_derivatives_with_terminal_effects_equal_finite_differences(build: Build, device: BothModes) -> None:
    nominal = stack_of(build, build.steps[0])
    f: NDArray[np.float64] = BANDS[0][::37]
    for effect in outside_effects():
        where = effect.places(nominal)[0]
        values = {knob.name: knob.null + 0.5 * knob.typical for knob in effect.effect_parameters(nominal, where)}
        seen = Device(device, (Added(effect, where, values),), nominal=nominal)
        names = ["disk.s11E.re", "area", *(f"{effect.name}@{where}.{knob}" for knob in values)]
        Z, slopes = seen.jacobian(f, names)
        np.testing.assert_allclose(Z, seen.impedance(f), rtol=1e-12)
        for name, slope in zip(names, slopes, strict=True):
            step = 1e-4 * seen.parameters()[name]
            up, down = (seen.replace({name: seen.parameters()[name] + side * step}).impedance(f) for side in (1, -1))
            np.testing.assert_allclose(slope * step, np.log(up / down) / 2, rtol=1e-3, atol=1e-9, err_msg=name)


def test_without_its_peaks_it_begins_with_the_library(
    build: Build, device: BothModes, swept: Callable[..., Sweep]
) -> None:
    between = np.linspace(150e3, 300e3, 60)
    hand = ManualFit(FitTask(build, {"disk": (swept(device, between),)}), "radial")
    assert hand.look().says == (
        "It starts from the library's values, because the recording gives no start: no radial resonance in "
        "150-300 kHz: the first is expected near 124 kHz for a diameter of 16 mm.",
    )
    v = build.layer("disk").values
    assert {h.name: h.value for h in hand.look().handles}["disk.s11E"] == pytest.approx(v["s11E"].re, rel=1e-6)


@pytest.mark.parametrize("fitter", ["disk"])
def test_a_model_that_a_step_cannot_have_is_not_offered_and_refused(task: FitTask, build: Build) -> None:
    assert models_for(build, "disk") == ("mason", "radial", "disk")
    assert models_for(replace(build, diameter=None), "disk") == ("mason",)
    with pytest.raises(FitError, match="nothing can be taken in hand with 'bvd': there are mason, radial, disk"):
        ManualFit(task, "bvd")
    above = {"disk": (task.sweeps["disk"][2],)}
    with pytest.raises(FitError, match=r"no band holds 20 points of any sweep: 0 to 0\.569 MHz; wider bands"):
        ManualFit(replace(task, sweeps=above), "radial").look()
