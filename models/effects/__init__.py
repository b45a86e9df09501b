"""The catalogue of physics that a model may lack, one file per effect.

A file of this folder that defines `EFFECT` is in the catalogue; a new effect needs no other change.
"""

from functools import cache
from importlib import import_module
from pkgutil import iter_modules

from ..base.errors import PzctlError
from ..base.names import among
from .base.assembly import Assembly, Conditions
from .base.device import Added, Device
from .base.effect import Effect, EffectParameter, Stage

__all__ = [
    "Added",
    "Assembly",
    "Conditions",
    "Device",
    "Effect",
    "EffectError",
    "EffectParameter",
    "Stage",
    "catalogue",
    "find_effect",
    "outside_effects",
]


class EffectError(PzctlError):
    """An effect that is not in the catalogue."""


@cache
def catalogue() -> tuple[Effect, ...]:
    """Return every effect, sorted by name."""
    modules = (import_module(f"{__name__}.{module.name}") for module in iter_modules(__path__))
    effects = (module.EFFECT for module in modules if hasattr(module, "EFFECT"))
    return tuple(sorted(effects, key=lambda effect: effect.name))


def find_effect(name: str) -> Effect:
    """Return the effect named `name`. Raises EffectError."""
    for effect in catalogue():
        if effect.name == name:
            return effect
    raise EffectError(f"effect {name!r} is not known; {among(name, [effect.name for effect in catalogue()])}")


def outside_effects() -> tuple[Effect, ...]:
    """Return the effects between a device and the analyzer, which any model can have: those that are looked for."""
    outside = (effect for effect in catalogue() if effect.outside and effect.stage is not Stage.ACQUISITION)
    return tuple(effect for effect in outside if not effect.only_named)
