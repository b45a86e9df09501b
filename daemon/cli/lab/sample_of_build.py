"""A sample for the simulated bench, drawn from a build: its constants scatter as the build's uncertainties say."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from ....fitters.engine.parameters.assembly import effects_of, stack_of
from ....fitters.engine.parameters.known_effects import with_effects
from ....models.build import Build, LayerSpec, Quantity
from ....sim.bench.sample import BenchSample

_MOST = 2.0
"""Largest deviation in standard uncertainties."""
_PASSIVE = 0.9
"""Largest piezoelectric loss as part of what passivity allows."""


def sample_of(build: Build, seed: int) -> BenchSample:
    """Return the transducer of this seed: the same one every time."""
    random = np.random.default_rng([seed, 4294])
    drawn = _drawn_build(build, lambda: float(np.clip(random.standard_normal(), -_MOST, _MOST)))
    stacks = {step.name: stack_of(drawn, step) for step in drawn.steps}
    known = effects_of(drawn)
    beside = {step: with_effects(stack, step, known) for step, stack in stacks.items()} if known else {}
    return BenchSample(seed, stacks, beside=beside)


def _drawn_build(build: Build, deviate: Callable[[], float]) -> Build:
    def drawn(quantity: Quantity) -> Quantity:
        re = quantity.re * np.exp(deviate() * quantity.u / abs(quantity.re)) if quantity.re else quantity.re
        if quantity.bounds is not None:
            re = np.clip(re, *quantity.bounds)
        im = quantity.im * np.exp(deviate() * quantity.u_im / abs(quantity.im)) if quantity.im else quantity.im
        return replace(quantity, re=float(re), im=float(im))

    first = {
        f"{layer.name}.{name}": drawn(quantity)
        for layer in build.layers
        for name, quantity in layer.values.items()
        if quantity.same_as is None
    }

    def own(layer: LayerSpec) -> LayerSpec:
        values = {
            name: replace(first[quantity.same_as or f"{layer.name}.{name}"], same_as=quantity.same_as)
            for name, quantity in layer.values.items()
        }
        return replace(layer, values=_passive(values) if layer.kind == "piezo" else values)

    steps = tuple(
        replace(step, reground={name: drawn(thickness) for name, thickness in step.reground.items()})
        for step in build.steps
    )
    bolt = build.bolt and replace(build.bolt, stiffness=drawn(build.bolt.stiffness))
    return replace(build, area=drawn(build.area), layers=tuple(map(own, build.layers)), steps=steps, bolt=bolt)


def _passive(values: dict[str, Quantity]) -> dict[str, Quantity]:
    """Return the constants with a piezoelectric loss that the other two losses allow (Holland, 1967)."""
    most = _PASSIVE * float(np.sqrt(max(0.0, values["c33D"].im * (1 / values["eps33S"].value).imag)))
    h33 = values["h33"]
    return values | {"h33": replace(h33, im=float(np.clip(h33.im, -most, most)))}
