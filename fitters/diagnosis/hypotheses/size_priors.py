"""Priors of effect sizes, as coordinates with unit normal prior."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from ....models.base.arrays import Reals
from ....models.effects import EffectParameter
from ...engine.parameters.coordinates import Block, between
from ...error_model.marginal import FormulaError
from .problem import Candidate

_LOGISTIC = 1.7
"""Standard deviation of the normal density closest to the logistic one, the prior of a `between` coordinate."""
_FAR = 6.0
"""Logit beyond which the error of a formula in a parameter fades: it is close to a limit that it cannot pass."""
_DEEPEST = 6.0
"""Standard deviations below the median at which a size counts as zero."""
_TAIL, _SHARE = 4.0, 0.1
"""One size in ten comes from a density four times as wide, because no list of known sizes is complete."""
_UNUSUAL = float(np.sqrt(2 * np.log((1 - _SHARE) * _TAIL / _SHARE) / (1 - _TAIL**-2)))
"""Standard deviations from the median beyond which a size more probably comes from the wide density: 2.8."""
_USUAL = 2.0
"""Standard deviations within which nineteen in twenty known sizes are."""
WRONG, GROSS = 10.0, 0.01
"""One dimension of a build in a hundred comes from a density ten times as wide: a slip of the pen, another sample."""


def block_of(name: str, knob: EffectParameter) -> Block:
    """Return the block of a parameter; its coordinate has a normal prior: mean zero, standard deviation `width`."""
    centre, spread = knob.expected
    if knob.from_nothing and not knob.fraction:
        return _log_normal(name, centre, spread, knob.upper)
    if np.isfinite(knob.upper) and knob.lower > 0:
        return between(name, knob.lower, knob.upper)
    return _normal(name, centre, spread, (knob.lower, knob.upper))


def _log_normal(name: str, median: float, spread: float, upper: float) -> Block:
    highest = (np.log(upper / median) / spread) if np.isfinite(upper) else np.inf

    def forward(x: Reals) -> tuple[Reals, Reals]:
        p = median * np.exp(spread * np.minimum(x, highest))
        return p, (spread * p)[:, None]

    def inverse(p: Reals) -> Reals:
        return np.maximum(np.log(np.maximum(p / median, 1e-300)) / spread, -_DEEPEST)

    return Block((name,), (name,), forward, inverse)


def _normal(name: str, mean: float, spread: float, limits: tuple[float, float]) -> Block:
    low, high = limits

    def forward(x: Reals) -> tuple[Reals, Reals]:
        return np.clip(mean + spread * x, low, high), np.array([[spread]])

    def inverse(p: Reals) -> Reals:
        return (p - mean) / spread

    return Block((name,), (name,), forward, inverse)


def width(knob: EffectParameter) -> float:
    """Return the prior standard deviation of a parameter's coordinate."""
    return _LOGISTIC if not knob.from_nothing and np.isfinite(knob.upper) and knob.lower > 0 else 1.0


class SizePriors:
    """Priors of the sizes of some effects, in the coordinates of a fit."""

    def __init__(self, effects: Sequence[Candidate], free: Sequence[str]) -> None:
        owners = [one for one in effects for _ in one.parameters]
        names = [name for one in effects for name in one.parameters]
        knobs = [knob for one in effects for knob in one.effect_parameters]
        self._width = np.array([width(knob) for knob in knobs])
        sizes = [(k, one) for k, (one, knob) in enumerate(zip(owners, knobs, strict=True)) if knob.from_nothing]
        several = [[k for k, own in sizes if own is one and names[k] in dict(one.sizes)] for one in effects]
        self._several = [group for group in several if len(group) > 1]
        """Positions of the sizes of each effect that has several that start from nothing."""
        self._spread = np.array([knob.expected[1] for knob in knobs])
        self._absent = np.array([knob.absent for knob in knobs])
        self._optional = [k for k, knob in enumerate(knobs) if knob.in_proportion]
        self._deviations = np.zeros((len(knobs), len(free)))
        """Deviations from what is usual, in standard deviations, per coordinate, shape (K, M)."""
        for row, one, name, knob in zip(self._deviations, owners, names, knobs, strict=True):
            row[free.index(name)] = 1 / width(knob)
            if knob.in_proportion:
                row[free.index(one.parameters[0])] = -one.effect_parameters[0].expected[1] / knob.expected[1]

    def rows(self, x: Reals) -> tuple[Reals, Reals]:
        """Return residuals of unit variance, shape (K,), and their derivatives, shape (K, M)."""
        return self._deviations @ x, self._deviations

    def log_volume(self) -> float:
        """Return ln of the peak prior density, without the powers of 2 pi that cancel in Laplace's integral."""
        return -float(np.sum(np.log(self._width)))

    def log_tails(self, x: Reals) -> float:
        """Return the change of ln prior density at `x` due to the wide tails, and to sizes that may be absent."""
        z = self._deviations @ x
        mixed = _mixed(z, _SHARE, _TAIL)
        others = [np.delete(group, np.argmax(z[group])) for group in self._several]
        optional = np.concatenate([*others, self._optional]).astype(np.intp)
        absent = self._absent[optional]
        mixed[optional] = (1 - absent) * mixed[optional] + absent * self._without(z, optional)
        return _over_normal(mixed, z)

    def _without(self, z: Reals, optional: NDArray[np.intp]) -> Reals:
        """Return the evidence without each of these sizes, relative to a prior at its median; they are `z` from there.

        At a minimum the data push a size below its median as hard as the prior pulls it up, z per deviation. What they
        lose by a small size is proportional to it, so it is -z/spread, and the data's curvature -z spread: without
        that size neither is there. Zero above the median, where the data want it.
        """
        below = np.maximum(-z[optional], 0.0)
        spread = self._spread[optional]
        return np.where(z[optional] > 0, 0.0, np.exp(below / spread) * np.sqrt(1 + below * spread))


def log_tails_of(z: Reals, in_fit: Reals) -> float:
    """Return ln of the prior density of values z standard uncertainties from what a build says, over that of a fit.

    A dimension of a build may be wrong by more than its uncertainty says. `in_fit`: standard uncertainties of the
    normal density that a fit uses.
    """
    return _over_normal(_mixed(z, GROSS, WRONG), in_fit)


def _over_normal(density: Reals, z: Reals) -> float:
    """Return ln of densities at z over the normal one, in units of its largest value, summed."""
    return float(np.sum(np.log(np.maximum(density, 1e-300)) + z**2 / 2))


def _mixed(z: Reals, share: float, tail: float) -> Reals:
    return (1 - share) * np.exp(-(z**2) / 2) + share / tail * np.exp(-(z**2) / 2 / tail**2)


def unusual_size(one: Candidate, values: Mapping[str, float]) -> str:
    """Return a sentence on the first size of an effect that is far above all that is known of it; empty if none is.

    `values`: its parameters by their own names. The density of known sizes makes such a size less probable than that
    of all others, which an effect has in common with whatever else follows its law.
    """
    for _, knob in one.sizes:
        if knob.prior is None or not knob.from_nothing or knob.fraction or knob.in_proportion:
            continue
        median, spread = knob.prior
        value = values[knob.name]
        if value > median * np.exp(_UNUSUAL * spread):
            low, high = (median * float(np.exp(way * _USUAL * spread)) for way in (-1, 1))
            unit = "" if knob.unit == "1" else f" {knob.unit}"
            return (
                f"But its {knob.name} of {value:.2g}{unit} is far above the usual {low:.1g} to {high:.1g}{unit}: it "
                "may stand for something else that acts alike."
            )
    return ""


def formula_errors(effects: Sequence[Candidate]) -> dict[str, FormulaError]:
    """Return the errors of formulas: by effect, of its sizes together; and of each parameter that may vary, by name."""
    made: dict[str, FormulaError] = {}
    for one in effects:
        sizes = dict(one.sizes)
        how = one.effect.errs_roughly, one.effect.errs_in_time
        made[one.prefix] = FormulaError(tuple((name, _per_log(knob)) for name, knob in sizes.items()), *how)
        for name, knob in zip(one.parameters, one.effect_parameters, strict=True):
            if knob.varies and name not in sizes:
                made[name] = FormulaError(((name, _per_log(knob)),), *how)
    return made


def _per_log(knob: EffectParameter) -> Callable[[float], float]:
    """Return d coordinate / d ln parameter of the block that `block_of` returns."""
    if width(knob) == _LOGISTIC:
        # x is the logit of where ln p lies between the limits; dx = d ln p / (span part (1 - part))
        span = float(np.log(knob.upper / knob.lower))
        return lambda x: 2 * (1 + float(np.cosh(min(abs(x), _FAR)))) / span
    _, spread = knob.expected
    return (lambda x: 1 / spread) if knob.from_nothing else (lambda x: x)


def shown(values: Mapping[str, float], one: Candidate) -> dict[str, float]:
    """Return the parameters of an effect from the parameters of a fit, clipped to their limits."""
    return {
        knob.name: min(max(values[one.prefix + knob.name], knob.lower), knob.upper) for knob in one.effect_parameters
    }
