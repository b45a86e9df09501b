"""Corrections over frequency with their uncertainty: the smooth ones of a place, and those of fitted laws."""

from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Reals
from ....models.effects import Device
from ....models.effects.learned.corrections import Place
from ....models.effects.learned.learned import LearnedLaw
from ....models.effects.learned.smooth_correction import SmoothCorrection
from ...engine.recording import recorded_band
from ...error_model.uncertainty_sources import spread_of
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Candidate, Problem

_SHOWN = 60
"""Frequencies at which a correction is drawn."""
_TINY = 1e-6
"""Step of a coordinate by which a derivative is taken."""


@dataclass(frozen=True, eq=False)
class PlacedCorrection:
    """A fitted smooth correction at one place."""

    place: Place
    steps: tuple[str, ...]
    hypothesis: Hypothesis
    probability: float
    """Probability that the missing physics acts here, among all places and nowhere."""
    frequency: Frequencies
    """Hz, shape (K,)."""
    correction: Complexes
    """Posterior mean at these frequencies, dimensionless, shape (K,)."""
    u_re: Reals
    u_im: Reals
    """Standard uncertainties of its real and imaginary part, shape (K,)."""


def drawn(
    problem: Problem, place: Place, steps: tuple[str, ...], made: Hypothesis, probability: float
) -> PlacedCorrection:
    """Return the correction as a function of frequency with its posterior band."""
    effect = made.effects[-1].effect
    if not isinstance(effect, SmoothCorrection):
        raise TypeError(f"no smooth correction in {effect.name}")
    recordings = [recording for recording in problem.recordings if recording.step in steps]
    low, high = recorded_band(recordings)
    frequency = np.geomspace(low, high, _SHOWN)
    free = made.objective.coordinates.free
    at = [free.index(name) for name in made.effects[-1].parameters]
    a = np.array([made.values[name] for name in made.effects[-1].parameters])
    covariance = spread_of(made.fit).about_the_minimum[np.ix_(at, at)]
    unit = np.stack([effect.size * effect.basis.over(frequency, row) for row in np.eye(a.size)], axis=1)
    scale = np.array([_width(made, k) for k in at])
    columns = unit * scale
    u_re, u_im = _spread(columns.real, covariance), _spread(columns.imag, covariance)
    return PlacedCorrection(place, steps, made, probability, frequency, unit @ a, u_re, u_im)


def drawn_law(effect: LearnedLaw, one: Candidate, made: Hypothesis) -> PlacedCorrection:
    """Return the correction of a fitted law, the last effect of a hypothesis, as a function of frequency."""
    coordinates, x = made.objective.coordinates, made.fit.x
    at = [coordinates.free.index(name) for name in one.parameters]
    shown = next(own for own in made.objective.recordings if own.step in one.steps)
    if not isinstance(shown.model, Device):
        raise TypeError(f"no effect in {type(shown.model).__name__}")
    device, swept = shown.model.assembly, shown.sweep.frequency

    def drawn_with(x: Reals) -> tuple[Frequencies, Complexes]:
        values, _ = coordinates.forward(x)
        own = {knob.name: values[name] for name, knob in zip(one.parameters, one.effect_parameters, strict=True)}
        return effect.drawn(own, device, swept, _SHOWN)

    frequency, here = drawn_with(x)
    columns = np.stack([(drawn_with(x + _TINY * np.eye(x.size)[k])[1] - here) / _TINY for k in at], axis=1)
    covariance = spread_of(made.fit).about_the_minimum[np.ix_(at, at)]
    u_re, u_im = _spread(columns.real, covariance), _spread(columns.imag, covariance)
    quantity = "impedance" if effect.place.quantity == "load" else effect.place.quantity
    place = Place(effect.place.where, quantity)
    return PlacedCorrection(place, one.steps, made, 0.0, frequency, here, u_re, u_im)


def _spread(columns: Reals, covariance: Reals) -> Reals:
    """Return the standard uncertainty of a curve from the derivatives by its coefficients, shape (K, M)."""
    return np.asarray(np.sqrt(np.maximum(np.einsum("km,mn,kn->k", columns, covariance, columns), 0)), np.float64)


def _width(made: Hypothesis, k: int) -> float:
    """Return d parameter / d coordinate of a coefficient."""
    _, chain = made.objective.coordinates.forward(made.fit.x)
    names = made.objective.coordinates.parameters
    name = made.objective.coordinates.free[k]
    return float(chain[names.index(name), k])
