"""Random-effects model: scatter between samples apart from the uncertainty of each value, and outliers.

Model: x_i = m + b_i + e_i, with b_i of variance tau^2 (scatter between samples) and e_i of the known variance u_i^2
(uncertainty within). Everything follows from the generalised Q(tau^2) = sum (x_i - m)^2 / (u_i^2 + tau^2) at the
weighted mean m, which decreases with tau^2:

tau^2 is where Q equals its own expectation n - 1: R. C. Paule and J. Mandel, J. Res. NBS 87 (1982) 377; preferred to
DerSimonian and Laird's moment estimate, which is only its first step: R. DerSimonian and R. Kacker, Contemp. Clin.
Trials 28 (2007) 105. The interval of tau follows from the quantiles of Q: W. Viechtbauer, Stat. Med. 26 (2007) 37.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy import special
from scipy.optimize import brentq

from ...models.base.arrays import Reals

FALSE_ALARM = 0.01
"""Probability that an outlier is named in a population without any, for one constant; measured: 1 to 2.5 %."""


@dataclass(frozen=True)
class RandomEffects:
    """Scatter between samples, separated from the uncertainty within; units of the values."""

    mean: float
    """Mean weighted by 1/(u^2 + tau^2)."""
    u: float
    """Standard uncertainty of `mean`. It also gives the interval from Student's t with n - 1 degrees of freedom (Knapp
    and
    Hartung, 2003): at the Paule-Mandel tau both are the same."""
    tau: float
    """Standard deviation between samples."""
    tau_low: float
    """Lower limit of the 95 % interval of `tau`, which is wide for few samples."""
    tau_high: float


def random_effects(x: Reals, u: Reals) -> RandomEffects:
    """Estimate mean and scatter of values `x`, shape (n,), n >= 2, with standard uncertainties `u`.

    `u` must be all positive, or all 0: then `tau` is the plain standard deviation and `mean` the plain mean.
    """
    dof = x.size - 1
    low, high = (float(special.chdtri(dof, chance)) for chance in (0.025, 0.975))
    x_, u_, centre, scale = _standard(x, u)
    tau2 = _tau2_where(x_, u_, dof)
    mean, variance = _weighted_mean(x_, u_, tau2)
    tau_low, tau_high = (scale * math.sqrt(_tau2_where(x_, u_, q)) for q in (low, high))
    return RandomEffects(centre + scale * mean, scale * math.sqrt(variance), scale * math.sqrt(tau2), tau_low, tau_high)


def _standard(x: Reals, u: Reals) -> tuple[Reals, Reals, float, float]:
    """Return values and uncertainties normalised to zero mean and unit size, and the centre and scale removed.

    Constants come as 1e11 Pa and 1e-15 m/Pa, and are squared here.
    """
    centre = float(np.mean(x))
    scale = float(max(np.max(np.abs(x - centre)), np.max(u))) or 1.0
    return (x - centre) / scale, u / scale, centre, scale


def outliers(x: Reals, u: Reals) -> dict[int, float]:
    """Return the indices of the values that do not belong to the rest, with the probability of that by chance.

    Each value is compared with what the others predict for it (leave one out, Student's t; with `u` 0 this is Grubbs's
    test), the most extreme is set aside, and so on up to a third of them: a second outlier cannot hide behind the first
    (B. Rosner, Technometrics 25 (1983) 165). Probabilities are for the most extreme of all (Bonferroni). The usual
    median rule (3.5 MAD) is not used: it rejects a good sample in one of six populations of four. Nor is the normal
    distribution where the others scatter no more than their uncertainties: three samples cannot show that, and it
    rejects a good one in up to a third of the populations. Among four samples, only a far outlier is therefore
    detected.
    """
    x, u, _, _ = _standard(x, u)
    left = list(range(x.size))
    aside: dict[int, float] = {}
    count = 0
    for _ in range(x.size // 3):
        chances = [_chance(x[left], u[left], k) for k in range(len(left))]
        k = int(np.argmin(chances))
        aside[left[k]] = min(1.0, len(left) * chances[k])
        if aside[left.pop(k)] < FALSE_ALARM:
            count = len(aside)
    return dict(list(aside.items())[:count])


def _chance(x: Reals, u: Reals, k: int) -> float:
    """Return the two-sided probability of value `k` given the other values."""
    others = np.arange(x.size) != k
    dof = x.size - 2
    tau2 = _tau2_where(x[others], u[others], dof)
    mean, variance = _weighted_mean(x[others], u[others], tau2)
    spread = math.sqrt(tau2 + u[k] ** 2 + variance)
    off = abs(float(x[k]) - mean)
    if spread == 0:
        return 0.0 if off > 0 else 1.0
    return float(2 * special.stdtr(dof, -off / spread))


def _q(x: Reals, u: Reals, tau2: float) -> float:
    weight = 1 / (u**2 + tau2)
    mean = np.sum(weight * x) / np.sum(weight)
    return float(np.sum(weight * (x - mean) ** 2))


def _weighted_mean(x: Reals, u: Reals, tau2: float) -> tuple[float, float]:
    """Return the weighted mean and its variance."""
    total = u**2 + tau2
    if not total.any():  # all alike, and all exact
        return float(np.mean(x)), 0.0
    weight = 1 / total
    return float(np.sum(weight * x) / np.sum(weight)), float(1 / np.sum(weight))


def _tau2_where(x: Reals, u: Reals, q: float) -> float:
    """Return the tau^2 >= 0 at which Q falls to `q`; 0 if it is below from the outset."""
    highest = float(np.sum((x - np.mean(x)) ** 2)) / q  # Q(tau^2) never exceeds what it is with u = 0
    if not u.any() or highest == 0:
        return highest
    if _q(x, u, 0.0) <= q:
        return 0.0
    return highest * float(brentq(lambda t: _q(x, u, t * highest) - q, 0.0, 1.0, xtol=1e-15))
