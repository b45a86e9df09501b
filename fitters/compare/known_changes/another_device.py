"""Something else: not one device that changed in a few ways, but another one.

Two hypotheses compete with all that have names, so that enough changes of one device do not explain just anything:

- every resonance is another by itself, as among devices of one kind;
- the recording after has nothing to do with the one before: poles of its own, each of which pays for its numbers (at
  any place of the band, of any width). Poles describe any recording down to its noise, changes of a real device do not.
  So the two are held against each other at the accuracy that the changes reach: with what they leave as noise, and as
  many independent points as it has (coarsened likelihoods: Miller and Dunson, J. Am. Stat. Assoc. 114 (2019) 1113).
"""

import math
from dataclasses import dataclass, replace

import numpy as np

from ....models.base.arrays import Complexes, Frequencies, Impedances, Reals
from ....models.sweep import Sweep
from ...diagnosis.data_quality.pole_fit import Frame, PoleFit, fit_poles
from ..change import DEVICE, ChangeSize, Values
from ..errors.linearised import Linearised, Outcome
from ..errors.pair_errors import PairErrors
from ..pair import Pair
from ..resonances import Resonances, changed, resonances_of

ANOTHER = "another-device"
DEVICES_OF_A_KIND = (
    "Every resonance changed by itself: two devices of one kind, or a change that acts on each resonance differently."
)
NOTHING_IN_COMMON = (
    "The recordings have too little in common: two different devices, or a change that left little as it was."
)
ODDS = 0.03
_LN_WIDTH = 1.5
"""Standard deviation of the ln half width of a resonance that may be any."""
_PARTNER = 0.04
"""Relative distance within which a resonance after is that of before, among devices of one kind."""
_UNCORRELATED = 0.05
_GROUND, _REACH = 12, 5.0
"""Real poles of the fit's background, and how far beyond the band they lie, as in `pole_fit`."""
_KNOWN = 5.0
_SIZES = (("shift", 1e-2), ("ln Q", 0.5), ("ln strength", 0.3))
"""By how much resonances of devices of one kind differ, each by itself."""


@dataclass(frozen=True, eq=False)
class EveryResonance:
    """Every resonance changed by itself, and the capacitance: another device of one kind."""

    resonances: Resonances
    sizes: tuple[ChangeSize, ...]
    effect: str = ANOTHER
    where: str = DEVICE
    odds: float = ODDS
    starts: tuple[tuple[float, ...], ...] = ()
    says: str = DEVICES_OF_A_KIND

    def act(
        self, Z: Impedances, own: Resonances, frequency: Frequencies, values: Values
    ) -> tuple[Impedances, Resonances]:
        """Return Z with every pole moved by itself, and the remainder in proportion."""
        every = range(own.poles.size)
        shift, q, strength = (np.array([values[f"{name} {k}"] for k in every]) for name, _ in _SIZES)
        strengths = np.asarray(np.exp(strength), np.complex128)
        poles, residues = changed(own.poles, own.residues, shift, q, 0.0)
        now = Resonances(poles, residues * strengths)
        before = np.sum(own.seen(frequency), axis=1)
        rest = (1 / Z - before) * np.exp(values["capacitance"])
        return 1 / (rest + np.sum(now.seen(frequency), axis=1)), now


def every_resonance(pair: Pair, own: Resonances, after: PoleFit) -> tuple[EveryResonance, Reals] | None:
    """Return the hypothesis of devices of one kind, and where its fit begins: each pole at its neighbour after."""
    count = own.poles.size
    if not count:
        return None
    sizes = [ChangeSize("capacitance", "1", 0.0, 0.1, signed=True)]
    sizes += [ChangeSize(f"{name} {k}", "1", 0.0, spread, signed=True) for name, spread in _SIZES for k in range(count)]
    now = resonances_of(after, pair.frequency, pair.after)
    x = np.zeros(1 + 3 * count)
    free = list(range(now.poles.size))
    for k in np.argsort(-np.abs(own.residues / own.poles.real)).tolist():
        p = own.poles[k]
        near = [j for j in free if abs(now.poles[j].imag / p.imag - 1) < _PARTNER]
        if not near:
            continue
        j = min(near, key=lambda j: abs(now.poles[j] - p))
        free.remove(j)
        to = now.poles[j]
        shift = np.log(abs(to) / abs(p))
        q = np.log((abs(to) / -to.real) / (abs(p) / -p.real))
        strength = np.log(abs(now.residues[j]) / abs(own.residues[k])) - 2 * shift
        for m, value in enumerate((shift, q, strength)):
            x[1 + m * count + k] = min(max(float(value) / _SIZES[m][1], -_KNOWN), _KNOWN)
    return EveryResonance(own, tuple(sizes)), x


def log_odds_of_nothing_in_common(errors: PairErrors, at: Linearised, outcome: Outcome, shortfall: float) -> float:
    """Return ln evidence of poles of its own against that of changes that were linearised here, beside prior odds.

    Poles cannot gain more than the changes lack (`shortfall`, ln likelihood), and they pay for their numbers.
    """
    recorded, inside = errors.recorded, np.isfinite(errors.recorded.noise_after)
    left = outcome.left[inside]
    share = np.sqrt(inside.sum() / _independent(left))
    missed = float(np.sqrt(np.mean(np.abs(left) ** 2) / 2))
    noise = np.where(inside, share * np.hypot(recorded.noise_after, missed), np.inf)
    # What the changes leave contains the noise of the recording before.
    changes = errors.with_noise(noise, 0 * noise).outcome(at, (0.0,), outcome.sizes, rounds=1).log_evidence

    finite = np.where(inside, noise, 1.0)
    fit = fit_poles(Frame.of(Sweep(recorded.frequency, recorded.after), finite, inside))
    points = recorded.frequency.size
    relative = (fit.residual[:points] + 1j * fit.residual[points:]) * finite
    predicted = np.asarray(recorded.after / (1 - relative), np.complex128)
    pair = replace(recorded, before=recorded.after, noise_before=0 * noise, noise_after=noise)
    slopes: Complexes = -_numbers(fit)
    zero, x = np.zeros(points, np.complex128), np.zeros(int(slopes.shape[1]), np.float64)
    alone = Linearised(predicted, zero, slopes, slopes[:, :0], x, (), pair.frequency)
    none = Resonances(np.zeros(0, np.complex128), np.zeros(0, np.complex128))
    own = PairErrors(pair, (none, none))
    evidence = own.outcome(alone, (0.0,), outcome.sizes, rounds=1).log_evidence
    perfect = replace(alone, predicted=recorded.after, slopes=slopes[:, :0], x=x[:0])
    most = own.outcome(perfect, (0.0,), outcome.sizes, rounds=1).log_evidence
    # Numbers are where their fit is, not at the middle of their priors; and poles have no order among themselves.
    paid = 0.5 * 4 * fit.poles.size - math.lgamma(fit.poles.size + 1)
    return min(evidence - paid - changes, shortfall - (most - evidence + paid))


def _independent(left: Complexes) -> float:
    """Return how many of these numbers are independent, by their correlation from point to point."""
    power = float(np.sum(np.abs(left) ** 2))
    total = 1.0
    for lag in range(1, left.size // 2):
        correlation = float(np.vdot(left[:-lag], left[lag:]).real) / power
        if correlation < _UNCORRELATED:
            break
        total += 2 * correlation
    return max(left.size / total, 1.0)


def _numbers(fit: PoleFit) -> Complexes:
    """Return d ln Y / d each number of a rational fit, each with a unit prior for any device, shape (N, M)."""
    frame, s = fit.frame, fit.frame.s
    weight = frame.weight / frame.inverse
    low, high = s[0].imag, s[-1].imag
    real: Reals = low / _REACH * (_REACH**2 * high / low) ** (np.arange(_GROUND) / (_GROUND - 1))
    ground = [np.ones_like(s), s, 1 / s, 1 / (1 + s[:, None] / real)]
    width = -fit.poles.real
    up, down = 1 / (s[:, None] - fit.poles), 1 / (s[:, None] - np.conj(fit.poles))
    size = np.maximum(np.abs(fit.residues), 1.0)
    parts = [(up + down) * width * size, 1j * (up - down) * width * size]
    rho = fit.residues * width
    first, second = rho * up**2 * width, np.conj(rho) * down**2 * width
    anywhere = (high - low) / np.sqrt(2 * np.pi) / width
    moved = [-(first + second) * _LN_WIDTH, 1j * (first - second) * anywhere]
    return np.asarray(np.column_stack([*ground, *parts, *moved]) * weight[:, None], np.complex128)
