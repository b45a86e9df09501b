"""Properties of any stack: it is the same from both sides, passive, and causal."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from pzctl.models.stack import (
    CONSTANT,
    CausalConstantQ,
    Elastic,
    HalfSpace,
    LossLaw,
    Mass,
    Piezo,
    Piston,
    PowerLoss,
    Spring,
    Stack,
    StackError,
)

F = np.geomspace(40.0, 110e6, 60)
REFERENCE = 3e6


def decades(low: float, high: float) -> st.SearchStrategy[float]:
    return st.floats(low, high).map(lambda exponent: 10.0**exponent)


@st.composite
def piezos(draw: st.DrawFn, name: str, law: LossLaw = CONSTANT) -> Piezo:
    """Constants of a passive layer: |h''| stays below the bound of Holland's loss matrix."""
    stiffness, eps = draw(st.floats(5e10, 2e11)), draw(st.floats(2e-9, 2e-8))
    loss_c, loss_eps = draw(st.floats(0.002, 0.05)), draw(st.floats(0.002, 0.05))
    coupling = draw(st.floats(0.05, 0.75))
    h = coupling * np.sqrt(stiffness / eps)
    bound = 0.99 * np.sqrt(stiffness * loss_c * loss_eps / eps / (1 + loss_eps**2))
    return Piezo(
        name,
        thickness=draw(decades(-5, -2.5)),
        density=draw(st.floats(5000, 9000)),
        c33D=stiffness * (1 + 1j * loss_c),
        h33=h + 1j * bound * draw(st.floats(-1, 1)),
        eps33S=eps * (1 - 1j * loss_eps),
        polarity=draw(st.sampled_from([1, -1])),
        c_law=law,
        h_law=law,
        eps_law=law,
    )


@st.composite
def layers(draw: st.DrawFn, name: str, law: LossLaw = CONSTANT) -> Piezo | Elastic | Spring | Mass:
    kind = draw(st.sampled_from("peeesm"))
    if kind == "p":
        return draw(piezos(name, law))
    if kind == "s":
        return Spring(name, draw(decades(11, 16)), draw(st.floats(3, 300)))
    if kind == "m":
        return Mass(name, draw(decades(-5, 0)))
    z, c, q = draw(decades(5, 7.7)), draw(st.floats(900, 6000)), draw(st.floats(3, 1000))
    return Elastic(name, draw(decades(-7, -1.5)), z, c, q, law)


@st.composite
def loads(draw: st.DrawFn) -> HalfSpace | Piston:
    if draw(st.booleans()):
        return Piston("fluid", draw(decades(2, 7)), draw(st.floats(300, 2000)), draw(decades(-4, -2)))
    return HalfSpace("load", draw(st.sampled_from([0.0, 413.0, 1.5e6, 3e7])))


@st.composite
def stacks(draw: st.DrawFn, law: LossLaw = CONSTANT) -> Stack:
    made = [draw(layers(f"layer{i}", law)) for i in range(draw(st.integers(0, 5)))]
    made.insert(draw(st.integers(0, len(made))), draw(piezos("disk", law)))
    wiring = draw(st.sampled_from(["series", "parallel"]))
    return Stack(tuple(made), draw(loads()), draw(loads()), draw(decades(-6, -2)), wiring)


@settings(deadline=None, max_examples=80)
@given(stacks())
def test_a_stack_has_the_same_impedance_turned_around(stack: Stack) -> None:
    turned = Stack(stack.layers[::-1], stack.front, stack.back, stack.area, stack.connection)
    Z = stack.impedance(F)
    assert np.all(np.isfinite(Z))
    assert np.max(np.abs(turned.impedance(F) / Z - 1)) < 1e-9


@settings(deadline=None, max_examples=80)
@given(stacks())
def test_a_passive_stack_does_not_generate_energy(stack: Stack) -> None:
    Z = stack.impedance(F)
    assert np.all(Z.real >= -1e-13 * np.abs(Z))


@settings(deadline=None, max_examples=50)
@given(stacks(), st.floats(0.3, 3))
def test_scaling_lengths_scales_frequencies(stack: Stack, scale: float) -> None:
    """Twice the thickness at half the frequency has the same wave pattern: Z per area is multiplied by scale twice."""
    assert stack_scales(replace(stack, back=HalfSpace("b", 1e6), front=HalfSpace("f", 0.0)), scale) < 1e-9


def stack_scales(stack: Stack, scale: float) -> float:
    lengths = {f"{layer.name}.thickness": "thickness" for layer in stack.layers if isinstance(layer, Piezo | Elastic)}
    lengths |= {f"{layer.name}.mass": "mass" for layer in stack.layers if isinstance(layer, Mass)}
    values = stack.parameters()
    changed = {name: values[name] * scale for name in lengths}
    springs = [layer for layer in stack.layers if isinstance(layer, Spring)]
    changed |= {f"{layer.name}.stiffness": layer.stiffness / scale for layer in springs}
    found = stack.replace(changed).impedance(F / scale)
    return float(np.max(np.abs(found / (scale**2 * stack.impedance(F)) - 1)))


def pulse(stack: Stack) -> np.ndarray:
    """The reflection of a short pulse by the stack on a line of 50 ohm per mm2, sampled in time; negative times last.

    The pulse itself starts at t = 0: eight equal real poles, which are a causal filter.
    """
    df, n = 4e3, 1 << 15
    f = df * np.arange(1, n)
    Z = stack.impedance(f) * stack.area
    line = 5e-5
    answer = (Z - line) / (Z + line) / (1 + 1j * f / 4e6) ** 8
    return np.fft.irfft(np.concatenate([[1.0], answer]), 2 * n)


def early(stack: Stack) -> float:
    """The largest response in the last quarter of the period, which is before t = 0, over the largest of all."""
    h = np.abs(pulse(stack))
    return float(h[-h.size // 4 :].max() / h.max())


@st.composite
def damped(draw: st.DrawFn, laws: st.SearchStrategy[LossLaw]) -> Stack:
    """A stack that stops ringing after a tenth of the period; kt is real, so that it stays below 1 everywhere."""
    law, thickness = draw(laws), st.floats(1e-4, 1e-3)
    disk = draw(piezos("disk", law))
    h33 = draw(st.floats(0.1, 0.7)) * complex(np.sqrt(disk.c33D / disk.eps33S))
    disk = replace(disk, thickness=draw(thickness), h33=h33)
    z, c, q = draw(decades(6, 7)), draw(st.floats(1500, 4000)), draw(st.floats(10, 30))
    layer = Elastic("ml1", draw(thickness), z, c, q, law)
    return Stack((disk, layer), HalfSpace("backing", draw(st.floats(3e6, 9e6))), HalfSpace("water", 1.5e6))


CAUSAL = st.one_of(
    st.just(CausalConstantQ(REFERENCE)), st.floats(0, 1).map(lambda exponent: PowerLoss(REFERENCE, exponent))
)


@settings(deadline=None, max_examples=40)
@given(damped(CAUSAL))
def test_a_stack_of_causal_layers_does_not_respond_before_the_pulse(stack: Stack) -> None:
    assert early(stack) < 1e-6


def test_constant_loss_responds_before_the_pulse() -> None:
    """This is why causal laws exist, and shows that the test above can fail."""
    disk = Piezo("disk", 0.5e-3, 7700.0, 1.4e11 * (1 + 0.08j), 1.9e9 * (1 + 0.01j), 8e-9 * (1 - 0.08j))
    layer = Elastic("ml1", 0.4e-3, 6e6, 2400.0, 6.0)
    assert early(Stack((disk, layer), HalfSpace("backing", 5e6), HalfSpace("water", 1.5e6))) > 1e-4


def test_mistakes_in_a_law_are_named() -> None:
    with pytest.raises(StackError, match="exponent is 2; allowed is -1 to 1"):
        PowerLoss(1e6, 2.0)
