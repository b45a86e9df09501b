"""Constants of a ceramic as their values at its resonance, where a fit has those of their mean over the band.

A descent arrives where constants and smooth errors can move apart: errors are therefore relative to their mean,
weighted by how much each point feels the constant, and that is mostly at overtones. A loss that goes as f^0.2 is 10 to
15 % larger there, ten standard uncertainties. A constant that is told is the one at the frequency at which the ceramic
is half a wavelength thick, as in a data sheet; how well it is known there follows from the same columns, less their
values there.
"""

from dataclasses import replace

import numpy as np

from ...models.base.arrays import Complexes
from ...models.effects.base.corrected_constants import Corrections
from ...models.effects.base.scale import resonance
from . import prior_scales as scales
from .error_columns import stack_of
from .marginal_fit import MarginalFit
from .smooth_basis import ends_of, smooth

_LOSSY = "c33D", "eps33S"
"""Constants of a ceramic whose imaginary part has one sign."""
_FURTHEST = 2.0
"""Largest factor between a constant, or its loss, at the resonance and its mean: losses over a band of ten octaves at
the largest usual exponent. More is the error of a fit that describes nothing."""


def at_resonance(found: MarginalFit) -> MarginalFit:
    """Return the same fit with the ceramics' free constants at the resonance."""
    recordings, known = found.marginal.objective.recordings, found.minimum.corrections
    ends = ends_of([np.log(one.sweep.frequency[[0, -1]]) for one in recordings])
    there = np.clip([np.log(resonance(stack_of(found.models[-1])))], *ends)
    functions = smooth(there, ends, scales.LENGTH, scales.FEW_SMOOTH)[0]
    coordinates = found.marginal.objective.coordinates
    values, chain = coordinates.forward(found.x)
    moving = dict(zip(coordinates.parameters, np.any(chain != 0, axis=1), strict=True))
    corrections = dict[str, Complexes]() if known is None else dict(known.relative)
    means = dict(found.minimum.means or found.gram.columns.means)
    for name in found.marginal.of_layers:
        re, im = f"{name}.re", f"{name}.im"
        if name not in means or not (moving.get(re) and moving.get(im)):
            continue  # held, or of a passive layer, whose losses are told by its q
        if known is not None and name in corrections:
            factor = 1 + complex(np.interp(there, known.log_f, corrections[name])[0])
            value = complex(values[re], values[im]) * factor
            ratios = [value.real / values[re]]
            if name.endswith(_LOSSY):
                ratios.append(value.imag / values[im])
            if not all(1 / _FURTHEST < ratio < _FURTHEST for ratio in ratios):
                continue
            values |= {re: value.real, im: value.imag}
            corrections[name] = (1 + corrections[name]) / factor - 1
        means[name] = functions
    if known is not None:
        known = Corrections(known.log_f, corrections, known.paths, known.held)
    minimum = replace(found.minimum, x=coordinates.inverse(values), corrections=known, means=means)
    return MarginalFit.at(found.marginal, minimum)
