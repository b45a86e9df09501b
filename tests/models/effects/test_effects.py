"""The catalogue: properties of every effect at every place in any stack."""

import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pzctl
from pzctl.models.effects import Conditions, Device, EffectError, catalogue, find_effect
from pzctl.models.effects.base.effect import Stage
from pzctl.models.effects.base.modified_loads import FiniteBackingLoad
from pzctl.models.stack import AIR, CausalConstantQ, Elastic, HalfSpace, Piezo, Stack

DESIGN = {
    "prestress-bolt",
    "lead-inductance", "series-resistance", "stray-capacitance", "leakage", "cable", "electrode-mass", "local-mass",
    "bond-layer", "bond-void", "thickness-variation", "surface-layer", "lateral-modes", "loss-dispersion",
    "dielectric-dispersion", "face-load", "finite-backing", "spurious-resonance", "temperature-drift",
    "drive-nonlinearity", "sweep-lag", "polarity", "ageing", "electrode-sheet", "viscous-load",
    "piezoelectric-dispersion", "fixture-residual", "analyzer-error", "vessel-echo", "piston-radiation",
    "partial-layer", "closing-void", "curing", "glue-meniscus", "field-nonlinearity", "self-heating",
    "clamp", "temperature-gradient", "scatter",
}  # fmt: skip
WHERES = ("terminals", "sweep", "face:back", "face:front", "layer:", "interface:")
F = np.linspace(1e6, 15e6, 120)
WIDE = np.geomspace(40.0, 110e6, 120)
WEIGHTS, STEPS = np.array([-1, 9, -45, 45, -9, 1]) / 60, (-3, -2, -1, 1, 2, 3)
APPROXIMATE = {"sweep-lag": 1e-2, "drive-nonlinearity": 1e-3, "field-nonlinearity": 3e-3}
"""Accuracy of derivatives where the memory has few delays, softening is found by iteration, or the field is kept."""
LINEAR = [effect for effect in catalogue() if effect.stage < Stage.ACQUISITION]


def around(value: float) -> st.SearchStrategy[float]:
    return st.floats(0.7 * value, 1.4 * value)


@st.composite
def stacks(draw: st.DrawFn) -> Stack:
    """A passive disk with up to four layers in front of it and behind it, sometimes on a backing."""
    law = draw(st.sampled_from([None, CausalConstantQ(4e6)]))
    laws = {} if law is None else {"c_law": law, "h_law": law, "eps_law": law}
    c33D = draw(around(1.45e11)) * complex(1, draw(st.floats(0.005, 0.03)))
    eps33S = draw(around(8e-9)) * complex(1, -draw(st.floats(0.005, 0.03)))
    disk = Piezo("disk", draw(around(0.5e-3)), draw(around(7700)), c33D, complex(draw(around(1.7e9))), eps33S, **laws)

    def layer(name: str) -> Elastic:
        thickness = draw(st.sampled_from([5e-6, 20e-6, 140e-6, 500e-6]))
        return Elastic(name, thickness, draw(around(6e6)), draw(around(2500)), draw(st.floats(10, 100)))

    behind = [layer(f"b{k}") for k in range(draw(st.integers(0, 1)))]
    before = [layer(f"f{k}") for k in range(draw(st.integers(0, 3)))]
    back = draw(st.sampled_from([AIR, HalfSpace("tungsten", 5e6)]))
    front = draw(st.sampled_from([AIR, HalfSpace("water", 1.5e6)]))
    return Stack((*behind, disk, *before), back, front, draw(around(7.85e-5)))


@st.composite
def sizes(draw: st.DrawFn, device: Device, effect, where: str) -> dict[str, float]:
    """Physical values of an effect's parameters."""
    return {
        knob.name: min(max(knob.null + draw(st.floats(0.1, 3)) * knob.typical, knob.lower), knob.upper)
        for knob in effect.effect_parameters(device.bare, where)
    }


@st.composite
def devices(draw: st.DrawFn, effects=LINEAR) -> Device:
    """A stack with one to four different effects somewhere, in any order, swept upwards or downwards."""
    device = Device(draw(stacks()), conditions=Conditions(draw(st.sampled_from(["up", "down"]))))
    for effect in draw(st.lists(st.sampled_from(effects), min_size=1, max_size=4, unique=True)):
        places = effect.places(device.bare)
        if places:
            where = draw(st.sampled_from(places))
            device = device.with_effect(effect, where, draw(sizes(device, effect, where)))
    return device


def test_every_effect_of_the_design_is_there_and_speaks() -> None:
    assert {effect.name for effect in catalogue()} == DESIGN
    for effect in catalogue():
        for text in (effect.says.format(where="layer:disk"), effect.separates, *effect.references):
            assert len(text) > 15, effect.name
            assert "left-out physics" not in text, "no document that a user has"
    with pytest.raises(EffectError, match=r"'gremlins'.*cable"):
        find_effect("gremlins")


@settings(deadline=None, max_examples=30)
@given(stacks())
def test_at_its_null_value_an_effect_changes_nothing(stack: Stack) -> None:
    Z = stack.impedance(F)
    for effect in catalogue():
        for where in effect.places(stack):
            assert where.startswith(WHERES)
            device = Device(stack).with_effect(effect, where)
            assert np.max(np.abs(device.impedance(F) / Z - 1)) < 1e-12, (effect.name, where)


@settings(deadline=None, max_examples=15)
@given(stacks())
def test_the_first_parameter_of_every_effect_has_a_derivative_at_null(stack: Stack) -> None:
    for effect in catalogue():
        for where in effect.places(stack):
            for knob in effect.effect_parameters(stack, where):
                assert knob.lower <= knob.null <= knob.upper
                assert knob.typical > 0
            turned = effect.name == "temperature-gradient"  # on a plate with equal faces either sign does the same
            given = {effect.effect_parameters(stack, where)[0].name: 0.01} if turned else {}
            device = Device(stack).with_effect(effect, where, given)
            names = [name for name in device.parameters() if name not in stack.parameters()]
            _, J = device.jacobian(F, names)
            assert np.all(np.isfinite(J)), (effect.name, where)
            if names:
                size = np.sqrt(np.mean(np.abs(J[0]) ** 2)) * effect.effect_parameters(stack, where)[0].typical
                assert 1e-9 < size < 3, (effect.name, where)


def differences(device: Device, name: str) -> tuple[np.ndarray, float]:
    """d ln Z / d name by a sixth-order difference, and its rounding error."""
    value = device.parameters()[name]
    h = 1e-4 * (1e6 if name == "disk.h33.im" else abs(value))
    Z = device.impedance(F)
    logs = [np.log(device.replace({name: value + k * h}).impedance(F) / Z) for k in STEPS]
    return WEIGHTS @ logs / h, 1e-12 / h


@settings(deadline=None, max_examples=12)
@given(devices(catalogue()))
def test_derivatives_by_the_stacks_parameters_are_exact_with_any_effects(device: Device) -> None:
    """A drifting, late or too strongly driven device, too: next to a line that has moved those at rest are far off."""
    names = list(device.bare.parameters())
    within = max([1e-6, *(APPROXIMATE.get(one.effect.name, 0.0) for one in device.added)])
    _, J = device.jacobian(F, names)
    for name, row in zip(names, J, strict=True):
        expected, rounding = differences(device, name)
        assert np.max(np.abs(expected - row)) < within * np.max(np.abs(row)) + rounding, name


@settings(deadline=None, max_examples=30)
@given(devices(catalogue()), st.randoms())
def test_the_order_in_which_effects_are_added_does_not_matter(device: Device, random) -> None:
    turned = Device(device.bare, conditions=device.conditions)
    for one in random.sample(device.added, len(device.added)):
        turned = turned.with_effect(one.effect, one.where, one.values)
    assert np.array_equal(turned.impedance(F), device.impedance(F))


ONLY_DESCRIBE = ("spurious-resonance", "dielectric-dispersion", "piezoelectric-dispersion")


@settings(deadline=None, max_examples=50)
@given(devices([effect for effect in LINEAR if effect.name not in ONLY_DESCRIBE]))
def test_effects_do_not_generate_energy(device: Device) -> None:
    """Exceptions are a residue with a phase, a non-causal permittivity and a coupling that may lose more than both of
    what it couples: they only describe data."""
    Z = device.impedance(WIDE)
    assert np.all(np.isfinite(Z))
    assert np.all(Z.real >= -1e-10 * np.abs(Z))


@settings(deadline=None, max_examples=20)
@given(devices(catalogue()), st.sampled_from([-1e30, 1e30]))
def test_no_parameter_value_breaks_a_device(device: Device, extreme: float) -> None:
    own = device.bare.parameters()
    bounded = {
        one.prefix + knob.name
        for one in device.added
        for knob in one.effect.effect_parameters(device.bare, one.where)
        if np.isfinite(knob.upper) or extreme < 0
    }
    wild = device.replace({name: extreme for name in device.parameters() if name in bounded and name not in own})
    assert np.all(np.isfinite(wild.impedance(WIDE)))


def test_an_echo_that_fades_at_once_is_finite() -> None:
    for exponent in (-1.0, 0.0, 1.0):
        load = FiniteBackingLoad(HalfSpace("rod", 1e6), 1.0, 1e-5, 1e5, exponent, reference=1e6, loss=0.3)
        assert np.all(np.isfinite(load.factor(WIDE)))


def test_a_new_effect_is_one_new_file(tmp_path: Path) -> None:
    """In a copy of the package, one more file adds the effect to the catalogue."""
    root = Path(pzctl.__path__[0])
    copy = tmp_path / "pzctl"
    shutil.copytree(root / "models", copy / "models", ignore=shutil.ignore_patterns("__pycache__"))
    (copy / "__init__.py").touch()
    new = (copy / "models" / "effects" / "leakage.py").read_text().replace('"leakage"', '"moonlight"')
    (copy / "models" / "effects" / "moonlight.py").write_text(new)
    code = (
        f"import sys; sys.path.insert(0, {str(tmp_path)!r}); "
        "from pzctl.models.effects import find_effect as f; print(f('moonlight').name, f('leakage').name)"
    )
    # -I: PYTHONPATH and PYTHONSAFEPATH of this run must not make the child import another copy of the package.
    run = subprocess.run([sys.executable, "-I", "-c", code], capture_output=True, text=True, check=False)
    assert run.stdout.split() == ["moonlight", "leakage"], run.stderr
