"""The changes that a device of a build can have: catalogue effects, other constants of a layer, another step."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from itertools import product

import numpy as np

from ....models.build import Build
from ....models.effects import Device, Effect, EffectParameter, Stage, catalogue, find_effect
from ....models.stack import Elastic, Piezo, Stack
from ...engine.parameters.assembly import stack_of
from ..change import ChangeSize, Values
from .found_device import FoundDevice
from .model_change import ModelChange

_USUAL = 0.03
"""Prior odds of each kind of change, as of an element at the terminals."""
_COARSE = (-3.0, -2.0, -1.0, 0.0, 1.0, 2.0)
"""Coordinates at which the fit of an effect with several sizes begins."""


_LEVELS = 0.5
"""Prior odds of a dependence on the drive, where the recordings state two levels."""


def model_changes(
    build: Build,
    found: tuple[FoundDevice, FoundDevice],
    stripped: FoundDevice | None,
    levels: tuple[float | None, float | None],
) -> tuple[ModelChange, ...]:
    """Return every change of the device that was `found` before; what is gone refers to the device found after.

    `stripped`: the device found after if it is that of the step before. `levels`: those of both recordings, if stated.
    """
    before, after = found
    known = [effect for effect in catalogue() if not effect.only_named]
    there = [change for effect in known for change in _of_effect(effect, before, taken=False)]
    gone = [change for effect in known for change in _of_effect(effect, after, taken=True)]
    off = () if stripped is None else _glued(build, stripped, taken=True)
    return (
        *there, *gone, *_of_constants(before), *_of_levels(before, levels), *_glued(build, before, taken=False), *off
    )  # fmt: skip


def _of_levels(found: FoundDevice, levels: tuple[float | None, float | None]) -> Iterator[ModelChange]:
    """Yield the dependence on amplitude, for recordings at two levels (V): the same softening at another strain."""
    first, second = levels
    if first is None or second is None or first == second or not isinstance(found.device.bare, Stack):
        return
    effect = find_effect("drive-nonlinearity")
    for where in effect.places(found.device.reference):
        knobs = effect.effect_parameters(found.device.reference, where)
        yield ModelChange(
            effect.name,
            where,
            tuple(_size(knob) for knob in knobs),
            f"{where} softens and loses more with its strain: the drive level is {second:g} V instead of {first:g} V.",
            _driven(effect, where, second),
            found,
            _LEVELS,
            before=_driven(effect, where, first),
        )


def _driven(effect: Effect, where: str, level: float) -> Callable[[Device, Values], Device]:
    def apply(device: Device, values: Values) -> Device:
        at = replace(device, conditions=replace(device.conditions, level_V=level))
        return at.with_effect(effect, where, values)

    return apply


def _of_effect(effect: Effect, found: FoundDevice, *, taken: bool) -> Iterator[ModelChange]:
    """Yield an effect inside of the device at each of its places; `taken`: it was there before."""
    device = found.device
    if effect.outside or effect.stage is Stage.ACQUISITION or not isinstance(device.bare, Stack):
        return
    known = {(one.effect.name, one.where) for one in device.added}
    places = [where for where in effect.places(device.reference) if (effect.name, where) not in known]
    for where in places:
        knobs = effect.effect_parameters(device.reference, where)
        if not knobs or (taken and not knobs[0].from_nothing):
            continue
        says = effect.says.format(where=where)
        yield ModelChange(
            effect.name,
            where,
            tuple(_size(knob) for knob in knobs),
            f"Before, but not after: {says}" if taken else says,
            _adding(effect, where),
            found,
            _USUAL * effect.odds / len(places) / 2,
            taken,
            effect.sizes,
            _starts(effect, knobs),
            effect.shown if effect.shown({knob.name: knob.null for knob in knobs}) else None,
        )


def _adding(effect: Effect, where: str) -> Callable[[Device, Values], Device]:
    return lambda device, values: device.with_effect(effect, where, values)


def _size(knob: EffectParameter) -> ChangeSize:
    """Return the prior of a parameter within its physical limits."""
    centre, spread = knob.expected
    return ChangeSize(knob.name, knob.unit, centre, spread, not knob.from_nothing, (knob.lower, knob.upper))


def _starts(effect: Effect, knobs: tuple[EffectParameter, ...]) -> tuple[tuple[float, ...], ...]:
    """Return the coordinates where fits begin: sizes of all main parameters, and the values that an effect names."""
    if effect.sizes == 1 and not any(knob.scan for knob in knobs):
        return ()
    each: list[tuple[float, ...]] = []
    for k, knob in enumerate(knobs):
        size = _size(knob)
        if k < effect.sizes:
            each.append(_COARSE)
        elif knob.scan and size.signed:
            each.append(tuple((value - size.median) / size.spread for value in knob.scan))
        elif knob.scan:
            each.append(tuple(float(np.log(value / size.median)) / size.spread for value in knob.scan))
        else:
            each.append((0.0,))
    return tuple(product(*each))


def _of_constants(found: FoundDevice) -> Iterator[ModelChange]:
    """Yield the constants that may have changed, each with the others as they were.

    Those of a ceramic are c33E, e33 and eps33S, for these are its own; c33D and h33 follow from them.
    """
    stack = found.device.bare
    if not isinstance(stack, Stack):
        return
    for layer in stack.layers:
        where, count = f"layer:{layer.name}", len(stack.layers)
        changes = _of_ceramic() if isinstance(layer, Piezo) else _of_elastic()
        for effect, name, spread, says, change in changes:
            size = ChangeSize(name, "1", 0.0, spread, signed=True)
            apply = _changing(layer.name, name, change)
            yield ModelChange(effect, where, (size,), says.format(where=where), apply, found, _USUAL / count)


Constants = dict[str, float]
Constant = tuple[str, str, float, str, Callable[[Constants, float], Constants]]
"""Effect, name and spread of its size, sentence, and the constants of a layer with ln of the factor."""


def _of_ceramic() -> tuple[Constant, ...]:
    return (
        (
            "poling",
            "ln e33",
            0.1,
            "The polarisation of {where} is another: heat, stress, a field.",
            _e33,
        ),
        ("stiffness", "ln c33E", 1e-2, "The stiffness of {where} is another: temperature, ageing.", _c33E),
        ("permittivity", "ln eps33S", 3e-2, "The permittivity of {where} is another: temperature, ageing.", _eps33S),
        ("mechanical-loss", "ln tan", 0.5, "The mechanical loss of {where} is another.", _times("c33D.im")),
        ("dielectric-loss", "ln tan", 0.5, "The dielectric loss of {where} is another.", _times("eps33S.im")),
        ("thickness", "ln thickness", 1e-2, "The thickness of {where} is another.", _times("thickness")),
    )


def _of_elastic() -> tuple[Constant, ...]:
    return (
        ("thickness", "ln thickness", 0.3, "The thickness of {where} is another.", _times("thickness")),
        ("stiffness", "ln c", 0.1, "The stiffness of {where} is another: its cure, its temperature.", _times("c", "z")),
        ("mechanical-loss", "ln Q", 0.5, "The mechanical loss of {where} is another.", _times("q")),
    )


def _times(*names: str) -> Callable[[Constants, float], Constants]:
    return lambda own, ln: {name: own[name] * float(np.exp(ln)) for name in names}


def _in_basis(own: Constants, e: float = 0.0, c: float = 0.0, eps: float = 0.0) -> Constants:
    """Return c33D, h33 and eps33S after changes of ln e33, ln c33E and ln eps33S."""
    c33D, h33, eps33S = (complex(own[f"{name}.re"], own[f"{name}.im"]) for name in ("c33D", "h33", "eps33S"))
    c33E, e33 = (c33D - h33 * h33 * eps33S) * np.exp(c), h33 * eps33S * np.exp(e)
    s = eps33S * np.exp(eps)
    made = {"c33D": c33E + e33 * e33 / s, "h33": e33 / s, "eps33S": s}
    return {f"{name}.{part}": float(getattr(value, long)) for name, value in made.items() for part, long in _PARTS}


_PARTS = (("re", "real"), ("im", "imag"))


def _e33(own: Constants, ln: float) -> Constants:
    return _in_basis(own, e=ln)


def _c33E(own: Constants, ln: float) -> Constants:
    return _in_basis(own, c=ln)


def _eps33S(own: Constants, ln: float) -> Constants:
    return _in_basis(own, eps=ln)


def _changing(
    layer: str, name: str, change: Callable[[Constants, float], Constants]
) -> Callable[[Device, Values], Device]:
    prefix = f"{layer}."

    def apply(device: Device, values: Values) -> Device:
        own = {key.removeprefix(prefix): v for key, v in device.bare.parameters().items() if key.startswith(prefix)}
        return device.replace({prefix + key: value for key, value in change(own, values[name]).items()})

    return apply


def step_before(build: Build, step: str) -> str | None:
    """Return the step of a build before this one, if there is one whose layers all remain."""
    names = [one.name for one in build.steps]
    k = names.index(step)
    return names[k - 1] if k > 0 and set(build.steps[k - 1].layers) < set(build.steps[k].layers) else None


def _glued(build: Build, found: FoundDevice, *, taken: bool) -> Iterator[ModelChange]:
    """Yield the layers that the next step glues on; `taken`: those that came off, so that `found` is without them."""
    names = [step.name for step in build.steps]
    k, stack = names.index(found.described.step), found.device.bare
    if k + 1 == len(names) or not isinstance(stack, Stack):
        return
    after, own = stack_of(build, build.steps[k + 1]), {layer.name for layer in stack.layers}
    new = [layer for layer in after.layers if layer.name not in own]
    if not new or not own < {layer.name for layer in after.layers}:
        return
    elastic = [layer for layer in new if isinstance(layer, Elastic)]
    if len(elastic) == len(new):
        sizes = tuple(size for layer in elastic for size in _unknown(build, layer))
        both = " and ".join(layer.name for layer in new)
        says = f"{both} came off." if taken else f"{both} came on, as in step {names[k + 1]}."
        where = f"layer:{new[-1].name}"
        yield ModelChange("glued-layer", where, sizes, says, _with(after), found, _USUAL / 2, taken, main=0, alone=True)


def _unknown(build: Build, layer: Elastic) -> Iterator[ChangeSize]:
    """Yield the constants of a layer that its build is not sure of."""
    for name, quantity in build.layer(layer.name).values.items():
        if quantity.u > 0 and quantity.same_as is None:
            yield ChangeSize(f"{layer.name}.{name}", _UNITS[name], quantity.re, quantity.u / quantity.re)


_UNITS = {"z": "Rayl", "c": "m/s", "q": "1", "thickness": "m"}


def _with(after: Stack) -> Callable[[Device, Values], Device]:
    """Return the function that gives a device the layers that it lacks; all other parameters are its own."""

    def apply(device: Device, values: Values) -> Device:
        own = {name: value for name, value in device.bare.parameters().items() if name in after.parameters()}
        return replace(device, bare=after.replace({**own, **values}))

    return apply
