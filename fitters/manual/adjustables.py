"""Adjustable parameters of a manual fit: each constant, loss, dimension and effect as a real number with a range."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ...models.effects import EffectParameter
from ..disk.planar_result import PLANAR_UNITS
from ..engine.objective import LOADS
from ..engine.recording import Prior
from ..interface import FitError

_LOSS = ".loss"
_TURNED = {"eps33S", "eps33T", "s11E", "s12E", "d31"}
"""Constants whose loss is defined by `x (1 - j loss)`; for a stiffness, and h33, it is `x (1 + j loss)`."""
_EITHER = {"h33", "s12E", "d31"}
"""Constants whose loss may have either sign, within bounds given by the losses of others."""
_ANY_SIGN = {*_EITHER, "alpha", "d33f"}
_LEAST, _MOST = 1.3, 10.0
"""Slider ranges as factors up and down: thirty per cent for well-known constants, a decade for others."""
_SURE = 4.0
"""Standard uncertainties that a range covers at least."""
_AIR = 413.0
"""Rayl; a load may be fitted as zero."""
_TYPICAL = 5.0
"""Typical sizes that the range of an effect's parameter covers."""


@dataclass(frozen=True)
class Adjustable:
    """A real parameter of a fit that a person can change, hold or free. SI units."""

    name: str
    """As in `pzctl fit --free`; `disk.c33D.loss` is Im/Re of c33D, `effect@place.parameter` belongs to an effect."""
    unit: str
    value: float
    low: float
    high: float
    scale: Literal["log", "linear"]
    """Scale of a slider from `low` to `high`."""
    free: bool


def handles_of(
    names: Iterable[str],
    values: Mapping[str, float],
    priors: Iterable[Prior],
    effect_parameters: Mapping[str, EffectParameter],
    free: Iterable[str],
) -> tuple[Adjustable, ...]:
    """Return an adjustable for each coordinate in `names`; `values` are the model parameters of the fit.

    `effect_parameters`: those of chosen effects and of those that the build states, by full name.
    """
    known = {prior.parameter.removesuffix(".re"): prior.u for prior in priors}
    moving = set(free)
    return tuple(
        _of_effect(name, effect_parameters[name], values[name], name in moving)
        if name in effect_parameters
        else _of_constant(name, value_of(name, values), known.get(name), name in moving)
        for name in names
    )


def value_of(name: str, values: Mapping[str, float]) -> float:
    """Return an adjustable's value from the model parameters."""
    bare = name.removesuffix(_LOSS)
    if name in values:
        return values[name]
    re, im = values[f"{bare}.re"], values[f"{bare}.im"]
    return _sign(bare) * im / re if bare != name else re


def with_value(name: str, value: float, values: Mapping[str, float]) -> dict[str, float]:
    """Return the model parameters with one adjustable changed; changing a real part keeps the loss of the constant.

    Raises FitError for a value that is not finite or has an impossible sign, KeyError for an unknown adjustable.
    """
    bare = name.removesuffix(_LOSS)
    lowest = 0.0 if name in LOADS or not _positive(name) else np.nextafter(0.0, 1.0)
    if not np.isfinite(value) or (value < lowest and _positive(name)):
        needed = "a positive number" if _positive(name) else "a number"
        raise FitError(f"{name!r} cannot be {value:g}: {needed} is needed")
    if name in values:
        return {**values, name: value}
    re = values[f"{bare}.re"] if bare != name else value
    loss = _sign(bare) * value if bare != name else values[f"{bare}.im"] / values[f"{bare}.re"]
    return {**values, f"{bare}.re": re, f"{bare}.im": re * loss}


def _sign(bare: str) -> int:
    return -1 if _kind(bare) in _TURNED else 1


def _kind(name: str) -> str:
    """Return `h33` for `disk.h33.loss`, `thickness` for `ml1.thickness@ground`."""
    return name.removesuffix(_LOSS).rpartition(".")[2].partition("@")[0]


def _positive(name: str) -> bool:
    return "@" not in name.partition(".")[0] and _kind(name) not in _ANY_SIGN


def _of_constant(name: str, value: float, u: float | None, free: bool) -> Adjustable:
    kind = _kind(name)
    if name.endswith(_LOSS):
        return _loss(name, value, free)
    if name in LOADS:
        return Adjustable(
            name, "Rayl", value, max(min(value, _AIR), 1.0) / _MOST, max(value, _AIR) * _MOST, "log", free
        )
    wide = _MOST if kind == "q" else float(np.clip(1 + _SURE * (u or 0.0) / abs(value), _LEAST, _MOST))
    low, high = sorted((value / wide, value * wide))
    return Adjustable(name, PLANAR_UNITS.get(kind, "1"), value, low, high, "log" if low > 0 else "linear", free)


def _loss(name: str, value: float, free: bool) -> Adjustable:
    """Return the adjustable of a loss."""
    if _kind(name) in _EITHER:
        reach = max(0.05, 2 * abs(value))
        return Adjustable(name, "1", value, -reach, reach, "linear", free)
    middle = max(value, 1e-4)
    return Adjustable(name, "1", middle, middle / _MOST, middle * _MOST, "log", free)


def _of_effect(name: str, knob: EffectParameter, value: float, free: bool) -> Adjustable:
    low = max(knob.lower, min(knob.null - _TYPICAL * knob.typical, value - abs(value)))
    high = min(knob.upper, max(knob.null + _TYPICAL * knob.typical, value + abs(value)))
    return Adjustable(name, knob.unit, value, low, high, "linear", free)
