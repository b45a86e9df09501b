"""Dense recordings condensed to fewer points, for a search: groups of neighbours that say the same become one point.

The point in the middle of a group stays, less its own deviation from a smooth curve, plus the group's mean one. The
curve is that of stable poles, as any causal linear device allows, so that no model of the device decides what counts.
"""

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ....models.base.arrays import Complexes, Reals
from ....models.effects import Device
from ...engine.recording import Recording
from ...error_model.point_covariance import under_colour
from ...error_model.prior_scales import ROUGH_LENGTH
from ..data_quality.pole_fit import PoleFit
from .problem import Problem

_WIDE = ROUGH_LENGTH
"""Largest width of a group in ln f: three quarters of a rough error's variance are common to its points, so that its
size comes out 14 % too small; what is likely in the end is weighed by all points."""
_FAR = 0.2
"""Largest change of ln Z within a group: over so little of a resonance, derivatives are linear to 1 %."""
_BIASED = 0.3
"""Largest error of a mean that curvature causes, in units of its noise."""
_CURVED = 3
"""Number of groups that show a curvature."""
_WORTH = 0.6
"""Budget: part of the points that remains at most; to condense less is not worth the second fit with all points."""


def condensed(problem: Problem, colour: float) -> Problem:
    """Return the problem with condensed recordings; the same one if they would hardly be shorter.

    `colour`: correlation of the noise of neighbouring points. The recordings keep the timing of their sweeps.
    """
    most = _WORTH * problem.points
    sweeps = [one.sweep for one in problem.recordings]
    if sum(_Groups.of(np.log(own.frequency), np.log(own.impedance)).counts.size for own in sweeps) > most:
        return problem
    made = tuple(_condensed(*one, colour) for one in zip(problem.recordings, problem.causal, strict=True))
    shorter = replace(problem, recordings=made, proof=(), causal=())
    return shorter if shorter.points < most else problem


def _condensed(recording: Recording, fit: PoleFit, colour: float) -> Recording:
    """Return a recording with its points in groups."""
    sweep, kept = recording.sweep, np.isfinite(recording.noise)
    real, imaginary = np.split(fit.residual, 2)
    left = np.log(1 - (real + 1j * imaginary)[kept] * recording.noise[kept])  # ln(Z/Z_poles)
    sweep = sweep.at(kept)
    f, Z = sweep.frequency, sweep.impedance
    groups = _Groups.of(np.log(f), np.log(Z) - left).split_where_curved(left, recording.noise[kept])
    at = groups.middle
    own = recording.model
    if isinstance(own, Device):
        passed = own.conditions.passed(kept.size)[kept][at]
        own = replace(own, conditions=replace(own.conditions, points=tuple(passed.tolist())))
    few = replace(sweep, impedance=Z * np.exp(groups.mean(left)[groups.number] - left)).at(at)
    noise = np.sqrt(np.real(groups.mean(recording.noise[kept] ** 2)) / groups.counts)
    return replace(recording, sweep=few, model=own, noise=noise * _coloured(groups.counts, colour))


@dataclass(frozen=True, eq=False)
class _Groups:
    """Neighbouring points in groups."""

    number: NDArray[np.intp]
    """Of the group of each point, rising from 0, shape (N,)."""
    log_f: Reals

    @classmethod
    def of(cls, log_f: Reals, log_Z: Complexes) -> Self:
        """Return the widest groups that are allowed."""
        way = log_f / _WIDE + np.cumsum(np.abs(np.diff(log_Z, prepend=log_Z[0]))) / _FAR
        return cls(_numbered(np.floor(way - way[0])), log_f)

    def split_where_curved(self, left: Complexes, noise: Reals) -> Self:
        """Return groups over which means are as exact as their noise, shape (N,)."""
        made = self
        while True:
            small = np.sqrt(np.real(made.mean(noise**2)) / made.counts)
            curved = (made.bias(left) > _BIASED * small) & (made.counts > 1)
            if not np.any(curved):
                return made
            later = np.arange(noise.size) >= made.middle[made.number]
            made = type(self)(_numbered(made.number + 0.5 * (later & curved[made.number])), self.log_f)

    @cached_property
    def counts(self) -> NDArray[np.intp]:
        """Number of points of each group."""
        return np.bincount(self.number)

    @cached_property
    def middle(self) -> NDArray[np.intp]:
        """Index of the point in the middle of each group."""
        return np.cumsum(self.counts, dtype=np.intp) - (self.counts + 1) // 2

    def mean(self, values: Reals | Complexes) -> Complexes:
        """Return the mean of each group."""
        sums = [np.bincount(self.number, part) for part in (np.real(values), np.imag(values))]
        return (sums[0] + 1j * sums[1]) / self.counts

    def bias(self, left: Complexes) -> Reals:
        """Return by how much the means differ from the values at the centres, because of curvature between groups."""
        x, y = np.real(self.mean(self.log_f)), self.mean(left)
        if x.size < _CURVED:
            return np.zeros(x.size)
        bent = 2 * np.diff(np.diff(y) / np.diff(x)) / (x[2:] - x[:-2])
        variance = np.real(self.mean(self.log_f**2)) - x**2
        return np.abs(np.pad(bent, 1, mode="edge")) * np.maximum(variance, 0.0) / 2


def _numbered(labels: Reals) -> NDArray[np.intp]:
    """Return rising labels as numbers without gaps."""
    return np.cumsum(np.diff(labels, prepend=labels[0]) > 0, dtype=np.intp)


def _coloured(counts: NDArray[np.intp], colour: float) -> Reals:
    """Return the factor by which noise of this correlation between neighbours exceeds white noise in means of groups.

    The noise of single points was estimated from differences, which underestimate it.
    """
    lags = np.arange(1, int(np.max(counts)))
    shared = [1 + 2 * float(np.sum((1 - lags[: m - 1] / m) * colour ** lags[: m - 1])) for m in counts.tolist()]
    return np.sqrt(shared) / under_colour(colour)
