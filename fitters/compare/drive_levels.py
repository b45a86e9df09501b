"""A device at two drive levels: resonances soften and lose more where it moves most.

The amplitude of a resonance is the voltage over its motional capacitance C, so that a resonance with twice the Q
softens twice as much. The impedance of its branch grows with a power of the amplitude, 1 by Rayleigh's law:

    1/B = R + jwL + 1/(jwC) + (loss R + 2j softening/(wC)) a^exponent,    a in proportion to level |B|/(wC)

A resonance that bends is none of a few poles. So R, L and C, as they are without amplitude, are fitted to both
recordings; what they leave of the lower one is in both and cancels.
"""

from dataclasses import dataclass

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from ...models.base.arrays import Complexes, Frequencies, Impedances, Reals
from .change import DEVICE, ChangeSize, Values
from .pair import Pair
from .resonances import Resonances, State, changed, slope_of

_KNOWN_LEVEL, _SAME_LEVEL, _UNKNOWN_LEVEL = 0.5, 1e-4, 0.02
"""Prior odds of a dependence on amplitude if the files state two levels, one level, or none."""
_ROUNDS, _AGREED = 40, 1e-9
"""Of Newton's method for the amplitude of a bent resonance."""
_LEAST = 0.05
"""Smallest slope of the equation for the amplitude, relative to that without a bend: beyond, it jumps."""
_MOST, _STRIDE, _NEAR, _GROUND = 8, 4, 4.0, 4
"""Of the fit to both recordings: most resonances; one of how many points, and within how many widths of a resonance all
of them; polynomials of the ground's capacitance and conductance. Budgets."""
_APART = (1.0, 0.5, 0.25)
"""Distances below which poles describe one resonance, in the sum of their half widths."""
_STEP = 1e-4
_FORM, _DRIFT = 3e-4, 1e-4
"""Errors of ln Y by the form of the resonances, and of ln f, in that fit."""
_SPREADS = np.array([1.0, 0.5, 0.3])
"""Of each resonance's frequency (half widths), ln Q and ln strength about their starts."""
_FURTHEST = 5.0
"""Largest softening at which the fit begins, in standard deviations of its prior."""
_PART = 0.8
"""Amplitude of a moderately bent resonance, relative to that without a bend."""


@dataclass(frozen=True, eq=False)
class AmplitudeDependent:
    """Resonances soften and lose more with their amplitude: another drive level.

    Softening is that of the frequency. Softening and loss are those at the largest amplitude of the strongest resonance
    at the higher level.
    """

    resonances: Resonances
    """Those that drift: without amplitude where the levels are known, else of the recording before."""
    odds: float
    ratios: tuple[float, float]
    """The level before and after, relative to the higher one."""
    linear: Resonances
    """The resonances as they are without amplitude."""
    reached: float = 1.0
    """That largest amplitude, relative to what it would be without softening and further loss."""
    fitted: "Fitted | None" = None
    """How those resonances follow the law, so that they always describe the recording at the lower level."""
    starts: tuple[tuple[float, ...], ...] = ()
    effect: str = "drive-nonlinearity"
    where: str = DEVICE
    says: str = "Resonances are softer and lose more where the device moves most: it depends on the drive level."
    sizes: tuple[ChangeSize, ...] = (
        ChangeSize("softening", "1", 0.0, 2e-3, signed=True),
        ChangeSize("loss", "1", 0.0, 0.3, signed=True),
        ChangeSize("exponent", "1", 1.0, 0.3, signed=True, limits=(0.3, 4.0)),
    )

    @property
    def known(self) -> bool:
        """Whether the files state two levels."""
        return self.fitted is not None

    def act(self, Z: Impedances, own: Resonances, frequency: Frequencies, values: Values) -> State:
        """Return Z with every resonance bent as at the level after instead of that before."""
        softening, loss, exponent = values["softening"], values["loss"], values["exponent"]
        part = self.reached**-exponent
        law = part * softening, part * loss, exponent
        linear = self.linear if self.fitted is None else self.fitted.at(law)
        before, after = bent(self._drifted(linear, own), frequency, law, self.ratios)
        return 1 / (1 / Z + np.sum(after - before, axis=1)), own

    def _drifted(self, linear: Resonances, own: Resonances) -> Resonances:
        """Return the resonances without amplitude, drifted like the nearest one of the recording."""
        known = self.resonances
        if own is known:
            return linear
        near = np.argmin(np.abs(linear.poles[:, None] - known.poles), axis=1)
        factor, strength = own.poles / known.poles, own.residues / known.residues
        return Resonances(linear.poles * factor[near], linear.residues * strength[near])


Law = tuple[float, float, float]
"""Softening and loss at the amplitude that the strongest resonance would have without them, and the exponent."""


def bent(linear: Resonances, f: Frequencies, law: Law, ratios: tuple[float, float]) -> tuple[Complexes, Complexes]:
    """Return the admittances of the resonances at both levels, S, shape (N, P)."""
    softening, loss, exponent = law
    branch = linear.seen(f)
    reactance = np.abs(linear.poles) ** 2 / (2 * np.abs(linear.residues)) / f[:, None]  # of C, ohm
    peak = np.abs(linear.residues / linear.poles.real)
    strongest = int(np.argmax(peak))
    largest = np.max(np.abs(branch[:, strongest]) * reactance[:, strongest])
    change = loss / peak + 2j * softening * reactance
    first, second = (_at_level(branch, change, ratio / largest * reactance, exponent) for ratio in ratios)
    return first, second


def _at_level(branch: Complexes, change: Complexes, per_admittance: Reals, exponent: float) -> Complexes:
    """Return bent branches, S, shape (N, P), by Newton's method for the amplitude.

    `change`: of the impedance at unit amplitude, ohm; `per_admittance`: amplitude for each S.
    """
    if not np.any(per_admittance):
        return branch
    start = 1 / branch
    a = np.abs(branch) * per_admittance
    for _ in range(_ROUNDS):
        power = a**exponent
        z = start + change * power
        size = np.abs(z)
        slope = size + exponent * power * np.real(np.conj(z) * change) / size
        step = (per_admittance - a * size) / np.maximum(slope, _LEAST * size)
        a = np.clip(a + step, a / 2, 2 * a)
        if np.max(np.abs(step)) < _AGREED:
            break
    return np.asarray(1 / (start + change * a**exponent), np.complex128)


def driven(pair: Pair, own: Resonances, after: Resonances) -> AmplitudeDependent:
    """Return the dependence on amplitude; levels that are not stated or equal count as if that before were none."""
    first, second = pair.levels
    if not first or not second or first == second:
        odds = _UNKNOWN_LEVEL if first is None or second is None else _SAME_LEVEL
        return AmplitudeDependent(own, odds, (0.0, 1.0), _merged(own))
    ratios = first / max(first, second), second / max(first, second)
    if not after.poles.size:
        return AmplitudeDependent(own, _KNOWN_LEVEL, ratios, _merged(own))
    both, end = _fitted(pair, (own, after), ratios)
    linear, law = both.resonances(end.x), both.law(end.x)
    reached = _reached(linear, pair.frequency, law)
    sizes = AmplitudeDependent.sizes

    def coordinates(x: Reals) -> Reals:
        softening, loss, exponent = both.law(x)
        at = softening * reached**exponent, loss * reached**exponent, exponent
        return np.array([(value - size.median) / size.spread for value, size in zip(at, sizes, strict=True)])

    at = coordinates(end.x)
    steps = _STEP * np.eye(3, end.x.size)
    J = np.column_stack([(coordinates(end.x + step) - at) / _STEP for step in steps])
    covariance = J @ np.linalg.inv(end.jac.T @ end.jac)[:3, :3] @ J.T
    fitted = Fitted(both, end.x, both.followed(end.x), covariance)
    return AmplitudeDependent(linear, _KNOWN_LEVEL, ratios, linear, reached, fitted, (tuple(at.tolist()),))


def _reached(linear: Resonances, f: Frequencies, law: Law) -> float:
    """Return the largest amplitude of the strongest resonance at the higher level, relative to that without a bend."""
    k = int(np.argmax(np.abs(linear.residues / linear.poles.real)))
    sizes = [np.max(np.abs(Y[:, k]) / f) for Y in (linear.seen(f), bent(linear, f, law, (0.0, 1.0))[1])]
    return float(sizes[1] / sizes[0])


def _merged(own: Resonances, apart: float = 1.0) -> Resonances:
    """Return the strongest resonances; poles this near to a stronger one, in widths, are a part of it."""
    peak = np.abs(own.residues / own.poles.real)
    free = np.argsort(-peak).tolist()
    poles: list[complex] = []
    residues: list[complex] = []
    while free and len(poles) < _MOST:
        p = own.poles[free[0]]
        group = [k for k in free if abs(own.poles[k] - p) <= -apart * (own.poles[k].real + p.real)]
        free = [k for k in free if k not in group]
        poles.append(p)
        residues.append(np.abs(np.sum(own.residues[group])) * p / (1j * p.imag))
    return Resonances(np.array(poles), np.array(residues))


@dataclass(frozen=True, eq=False)
class _Both:
    """Both recordings on a part of their points, as the fit sees them."""

    frequency: Frequencies
    Y: tuple[Complexes, Complexes]
    sigma: tuple[Reals, Reals]
    """Standard deviation of ln Y."""
    start: Resonances
    ratios: tuple[float, float]
    sizes: tuple[ChangeSize, ...] = AmplitudeDependent.sizes

    def resonances(self, x: Reals) -> Resonances:
        """Return the resonances without amplitude."""
        moved = x[4:].reshape(3, -1) * _SPREADS[:, None]
        moved[0] /= 2 * self.start.q
        return Resonances(*changed(self.start.poles, self.start.residues, moved[0], moved[1], moved[2]))

    def law(self, x: Reals) -> Law:
        """Return softening, loss and exponent."""
        softening, loss, exponent = (size.value(float(z)) for size, z in zip(self.sizes, x[:3], strict=True))
        return softening, loss, exponent

    def residuals(self, x: Reals) -> Reals:
        """Return misfits and coordinates, each of a unit normal prior."""
        law, own = self.law(x), self.resonances(x)
        f, drift = self.frequency, float(np.exp(_DRIFT * x[3]))
        first = np.sum(bent(own, f, law, self.ratios)[0], axis=1)
        second = np.sum(bent(own, f / drift, law, self.ratios)[1], axis=1)
        rows = np.concatenate([(Y - B) / Y / s for Y, B, s in zip(self.Y, (first, second), self.sigma, strict=True)])
        real = np.concatenate([rows.real, rows.imag])
        left = real - self._ground @ (self._ground.T @ real)
        return np.concatenate([left, x])

    def followed(self, x: Reals) -> Reals:
        """Return how the resonances' coordinates follow those of the law for the recording at the lower level alone."""
        lower = 0 if self.ratios[0] < self.ratios[1] else 1
        at = self._misfits(x, lower)
        J = np.column_stack([(self._misfits(x + step, lower) - at) / _STEP for step in _STEP * np.eye(x.size)])
        J = np.delete(J, 3, axis=1)  # drift between the recordings
        law, own = J[:, :3], np.vstack([J[:, 3:], np.eye(x.size - 4)])
        return -np.linalg.lstsq(own, np.vstack([law, np.zeros((x.size - 4, 3))]), rcond=None)[0]

    def _misfits(self, x: Reals, k: int) -> Reals:
        """Return the misfit of one recording at its own ground."""
        own = np.sum(bent(self.resonances(x), self.frequency, self.law(x), self.ratios)[k], axis=1)
        row = (self.Y[k] - own) / self.Y[k] / self.sigma[k]
        real = np.concatenate([row.real, row.imag])
        return real - self._grounds[k] @ (self._grounds[k].T @ real)

    def __post_init__(self) -> None:
        u = np.log(self.frequency)
        polynomials = np.polynomial.chebyshev.chebvander((2 * u - u[0] - u[-1]) / (u[-1] - u[0]), _GROUND - 1)
        ground = np.hstack([1j * self.frequency[:, None] * polynomials, polynomials])
        rows = [ground / (Y * s)[:, None] for Y, s in zip(self.Y, self.sigma, strict=True)]
        object.__setattr__(self, "_grounds", [_basis(one) for one in rows])
        gain = np.concatenate([np.zeros(self.frequency.size), 1 / self.sigma[1]])[:, None]  # of one to the other
        object.__setattr__(self, "_ground", _basis(np.hstack([np.vstack(rows), gain, 1j * gain])))


def _basis(columns: Complexes) -> Reals:
    """Return an orthonormal basis of the real combinations of columns: real parts, then imaginary parts."""
    real = np.vstack([columns.real, columns.imag])
    return np.linalg.qr(real / np.linalg.norm(real, axis=0))[0]


@dataclass(frozen=True, eq=False)
class Fitted:
    """The resonances without amplitude as fitted to both recordings, and how they follow the law."""

    both: _Both
    x: Reals
    follow: Reals
    covariance: Reals
    """Of the law's coordinates in a hypothesis, by that fit, shape (3, 3)."""

    def at(self, law: Law) -> Resonances:
        """Return the resonances that describe the recording at the lower level, if this is the law."""
        x = self.x.copy()
        pairs = zip(law, self.both.sizes, strict=True)
        moved = np.array([(value - size.median) / size.spread for value, size in pairs]) - x[:3]
        x[4:] += self.follow @ moved
        return self.both.resonances(x)


def _fitted(
    pair: Pair, resonances: tuple[Resonances, Resonances], ratios: tuple[float, float]
) -> tuple[_Both, OptimizeResult]:
    """Return the fit to both recordings, with as many resonances as pay for their numbers (Akaike), and its end."""
    lower = resonances[int(ratios[1] < ratios[0])]
    f, kept = pair.frequency, _chosen(pair.frequency, resonances)
    sides = (pair.before, pair.noise_before), (pair.after, pair.noise_after)
    sigma = [
        np.sqrt(noise**2 + _FORM**2 + (_DRIFT * np.abs(slope_of(f, Z, own)[0])) ** 2)[kept]
        for (Z, noise), own in zip(sides, resonances, strict=True)
    ]
    Y = 1 / pair.before[kept], 1 / pair.after[kept]
    best: tuple[float, _Both, OptimizeResult] | None = None
    for start in {one.poles.size: one for one in (_merged(lower, apart) for apart in _APART)}.values():
        both = _Both(f[kept], Y, (sigma[0], sigma[1]), start, ratios)
        ends = [least_squares(both.residuals, x, max_nfev=30, xtol=1e-4, ftol=1e-4) for x in _starts(both, resonances)]
        end = min(ends, key=lambda end: float(end.cost))
        value = float(end.cost) + 3 * start.poles.size
        if best is None or value < best[0]:
            best = value, both, end
    if best is None:
        raise ValueError("no resonances")
    return best[1:]


def _chosen(f: Frequencies, resonances: tuple[Resonances, Resonances]) -> "np.ndarray[tuple[int], np.dtype[np.bool_]]":
    """Return which points are used: all near resonances, some of the others."""
    kept = np.arange(f.size) % _STRIDE == 0
    for own in resonances:
        kept |= np.any(np.abs(f[:, None] - own.poles.imag) < -2 * _NEAR * own.poles.real, axis=1)
    return kept


def _starts(both: _Both, resonances: tuple[Resonances, Resonances]) -> list[Reals]:
    """Return the coordinates where the fit begins: no bend, and that by which the strongest resonance moved."""
    strongest = [own.poles[int(np.argmax(np.abs(own.residues / own.poles.real)))] for own in resonances]
    moved = float(np.log(strongest[1].imag / strongest[0].imag))
    bend = -moved / (_PART * (both.ratios[1] - both.ratios[0])) / both.sizes[0].spread
    made = np.zeros((2, 4 + 3 * both.start.poles.size))
    made[1, 0] = np.clip(bend, -_FURTHEST, _FURTHEST)
    return list(made)
