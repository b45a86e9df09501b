"""What is known of a material's losses, and how probable an explanation is that needs other ones.

Fits are not drawn towards them: where the model is wrong, losses stand for what is missing. They tell explanations
apart: a liquid on a disk needs no ceramic of a third of its Q.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ....models.base.arrays import Reals
from ...engine.recording import Prior
from ...error_model.marginal_fit import MarginalFit
from .problem import Candidate
from .size_priors import GROSS, WRONG

_STEP = 1e-6
"""Relative step of differences."""


@dataclass(frozen=True)
class OwnLoss(Prior):
    """The imaginary part of a constant (`parameter`) without what effects add to it."""

    added: tuple[Candidate, ...]

    @property
    def _constant(self) -> str:
        return self.parameter.removesuffix(".im")

    @property
    def needs(self) -> tuple[str, ...]:
        """Both parts of the constant, and the effects' parameters."""
        return (self.parameter, f"{self._constant}.re", *(name for one in self.added for name in one.parameters))

    def predicted(self, values: Mapping[str, float]) -> float:
        """Return the material's own imaginary part."""
        added = sum(_losses(one, values)[self._constant] for one in self.added)
        return values[self.parameter] - values[f"{self._constant}.re"] * added

    def slopes(self, values: Mapping[str, float]) -> dict[str, float]:
        """Return the derivatives of the own part by the constant's parts and the effects' parameters."""
        slopes = {self.parameter: 1.0}
        for name in self.needs[1:]:
            step = _STEP * (abs(values[name]) or 1.0)
            above, below = (self.predicted({**values, name: values[name] + way * step}) for way in (1, -1))
            slopes[name] = (above - below) / (2 * step)
        return slopes


def _losses(one: Candidate, values: Mapping[str, float]) -> Mapping[str, float]:
    pairs = zip(one.effect_parameters, one.parameters, strict=True)
    return one.effect.added_losses(one.where, {knob.name: values[name] for knob, name in pairs})


def own_losses(known: Sequence[Prior], added: Sequence[Candidate]) -> tuple[Prior, ...]:
    """Return what is known of losses beside these effects: of the material's own."""
    by_constant: dict[str, tuple[Candidate, ...]] = {}
    for one in added:
        absent = {name: knob.null for knob, name in zip(one.effect_parameters, one.parameters, strict=True)}
        for constant in _losses(one, absent):
            by_constant[f"{constant}.im"] = (*by_constant.get(f"{constant}.im", ()), one)
    return tuple(
        OwnLoss(prior.parameter, prior.mean, prior.u, by_constant[prior.parameter])
        if prior.parameter in by_constant
        else prior
        for prior in known
    )


def log_losses(known: Sequence[Prior], fit: MarginalFit) -> float:
    """Return ln of the prior density of the losses over its largest value, averaged over what a fit leaves open.

    Each is normal, with tails as dimensions of a build have. What a fit leaves open of several layers together counts
    for each of them alone.
    """
    told, away, moved = _losses_at(known, fit)
    spread = moved @ np.linalg.lstsq(fit.value.H, moved.T, rcond=1e-12)[0]
    layers = [prior.parameter.partition(".")[0] for prior in told]
    total = 0.0
    for layer in dict.fromkeys(layers):
        own = np.flatnonzero([name == layer for name in layers])
        combinations = product((1.0, WRONG), repeat=own.size)
        total += np.logaddexp.reduce([_normal(away[own], spread[np.ix_(own, own)], one) for one in combinations])
    return float(total)


def drawn_by_losses(known: Sequence[Prior], fit: MarginalFit) -> tuple[Reals, Reals]:
    """Return the information (M, M) of the losses' priors, and minus the gradient (M,), in the coordinates of a fit."""
    _, away, moved = _losses_at(known, fit)
    return moved.T @ moved, moved.T @ away


def deviations_of(known: Sequence[Prior], fit: MarginalFit) -> Reals:
    """Return by how many standard uncertainties each of the losses that a fit has is off, shape (K,)."""
    return _losses_at(known, fit)[1]


def _losses_at(known: Sequence[Prior], fit: MarginalFit) -> tuple[Sequence[Prior], Reals, Reals]:
    """Return what is known of the losses that a fit has, and by how many standard uncertainties it is off there, (K,).

    With its derivatives by the coordinates, shape (K, M).
    """
    coordinates = fit.marginal.objective.coordinates
    row = {name: k for k, name in enumerate(coordinates.parameters)}
    told = [prior for prior in known if set(prior.needs) <= set(row)]
    values, chain = coordinates.forward(fit.x)
    away = np.array([(prior.predicted(values) - prior.mean) / prior.u for prior in told])
    slopes = np.zeros((len(told), len(row)))
    for own, prior in zip(slopes, told, strict=True):
        for name, slope in prior.slopes(values).items():
            own[row[name]] = slope / prior.u
    return told, away, slopes @ chain


def _normal(away: Reals, spread: Reals, widths: Sequence[float]) -> float:
    """Return ln of a normal density of these widths, with its share, averaged over N(away, spread)."""
    scale = np.array(widths)
    share = np.log(np.where(scale == 1.0, 1 - GROSS, GROSS / WRONG))
    whole = np.eye(scale.size) + spread / scale / scale[:, None]
    _, log_det = np.linalg.slogdet(whole)
    z = away / scale
    return float(np.sum(share)) - 0.5 * float(log_det + z @ np.linalg.solve(whole, z))
