"""Whether a build that a client sent is one that a device can have; no file's reader has checked it.

Names may be any that can be printed. Effects are left to the fitters, which know the catalogue, and so are constants
that a program which only measures leaves out.
"""

import math
from collections.abc import Iterator

from ....models.build import Build, Quantity
from .build_parts import check_parts
from .build_table import BuildError
from .file_keys import BELOW, LOSS_SIGN, POSITIVE
from .tied_parameters import resolved

LEAST, MOST = 1e-30, 1e30
"""Least and greatest size of a number in SI units; every constant of a device, and its uncertainty, is far inside."""


def check_sent_build(build: Build, source: str) -> None:
    """Raise BuildError, which calls the build `source`, for one that contradicts itself or that no device can have."""
    check_parts(build, source)
    for where, name, quantity in _quantities(build):
        _check_quantity(f"{source}: {where}", name, quantity)
    resolved(build.layers, source)


def _quantities(build: Build) -> Iterator[tuple[str, str, Quantity]]:
    """Yield each number of a build: its place, the name of the constant, and the number."""
    yield "area", "area", build.area
    if build.diameter is not None:
        yield "diameter", "diameter", build.diameter
    if build.hole_diameter is not None:
        yield "hole_diameter", "hole_diameter", build.hole_diameter
    yield "back.z", "load", build.back.z
    yield "front.z", "load", build.front.z
    if build.bolt is not None:
        yield "bolt.stiffness", "stiffness", build.bolt.stiffness
    for k, layer in enumerate(build.layers):
        for part, values in (("values", layer.values), ("nominal", layer.nominal)):
            for name, quantity in values.items():
                yield f"layers[{k}].{part}.{name}", name, quantity
    yield from _of_steps(build)
    for k, effect in enumerate(build.effects):
        for name, quantity in effect.values.items():
            yield f"effects[{k}].values.{name}", "", quantity


def _of_steps(build: Build) -> Iterator[tuple[str, str, Quantity]]:
    for k, step in enumerate(build.steps):
        for name, quantity in step.reground.items():
            yield f"steps[{k}].reground.{name}", "thickness", quantity
        if step.mass is not None:
            yield f"steps[{k}].mass", "mass", step.mass


def _check_quantity(where: str, name: str, quantity: Quantity) -> None:
    low, high = quantity.bounds or (-math.inf, math.inf)
    for part, value in (("re", quantity.re), ("im", quantity.im), ("u", quantity.u), ("u_im", quantity.u_im)):
        if value and not LEAST <= abs(value) <= MOST:
            raise BuildError(f"{where}.{part} is {value:g}; a size from {LEAST:g} to {MOST:g} is needed, or zero")
    if name == "load" and quantity.re < 0:  # zero: a vacuum
        raise BuildError(f"{where}.re is {quantity.re:g}; zero or a positive number is needed")
    if name in POSITIVE and quantity.re <= 0:
        raise BuildError(f"{where}.re is {quantity.re:g}; a positive number is needed")
    if quantity.re >= BELOW.get(name, math.inf):
        raise BuildError(f"{where}.re is {quantity.re:g}; a number below {BELOW[name]:g} is needed")
    if quantity.im * LOSS_SIGN.get(name, 0) < 0:
        sign = "zero or positive" if LOSS_SIGN[name] > 0 else "zero or negative"
        raise BuildError(f"{where}.im is {quantity.im:g}, a gain; with exp(+jwt) {sign} is needed")
    if quantity.u < 0 or quantity.u_im < 0:
        least = min(quantity.u, quantity.u_im)
        raise BuildError(f"{where} has the uncertainty {least:g}; zero or a positive number is needed")
    if quantity.bounds is not None and not low < quantity.re < high:
        raise BuildError(f"{where}.bounds is {low:g} to {high:g}; {quantity.re:g} must lie between them")
    if quantity.same_as is not None and not quantity.same_as.endswith(f".{name}"):
        raise BuildError(f"{where}.same_as is {quantity.same_as!r}; {name} of another layer is needed: LAYER.{name}")
