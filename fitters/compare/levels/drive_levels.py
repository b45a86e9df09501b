"""The change of a device by another drive level: resonances soften and lose more where it moves most."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ....models.base.arrays import Frequencies, Impedances, Reals
from ..change import DEVICE, ChangeSize, Values
from ..pair import Pair
from ..resonances import Resonances, State
from .amplitude_law import SIZES, Law, bent, strongest
from .level_fit import LevelFit, fitted_to_both, merged

_KNOWN_LEVEL, _SAME_LEVEL, _UNKNOWN_LEVEL = 0.5, 1e-4, 0.02
"""Prior odds of a dependence on amplitude if the files state two levels, one level, or none."""
_STEP = 1e-4


@dataclass(frozen=True, eq=False)
class AmplitudeDependent:
    """Resonances soften and lose more with their amplitude: another drive level.

    Softening is that of the frequency. Softening and loss are those at the largest amplitude of the strongest resonance
    at the higher level.
    """

    resonances: Resonances
    """Those that drift: as without amplitude where the levels are known, else those of the recording before."""
    odds: float
    ratios: tuple[float, float]
    """The level before and after, relative to the higher one."""
    linear: Resonances
    """The resonances as they are without amplitude."""
    fit: LevelFit | None = None
    """None if the levels are not known."""
    effect: str = "drive-nonlinearity"
    where: str = DEVICE
    says: str = "Resonances are softer and lose more where the device moves most: it depends on the drive level."
    sizes: tuple[ChangeSize, ...] = SIZES

    @property
    def known(self) -> bool:
        """Whether the files state two levels."""
        return self.fit is not None

    @property
    def starts(self) -> tuple[tuple[float, ...], ...]:
        """Coordinates where a fit to the pair begins."""
        return () if self.fit is None else (tuple(self._coordinates(self.fit.law).tolist()),)

    @cached_property
    def covariance(self) -> Reals:
        """Covariance of the coordinates by the resonances without amplitude, as fitted, shape (3, 3)."""
        if self.fit is None:
            return np.zeros((len(SIZES), len(SIZES)))
        at, count = self.fit.x, len(SIZES)
        here = self._coordinates(self.fit.law)
        steps = _STEP * np.eye(count, at.size)
        J = np.column_stack([(self._coordinates(self.fit.both.law(at + step)) - here) / _STEP for step in steps])
        return np.asarray(J @ self.fit.inverse[:count, :count] @ J.T, np.float64)

    def act(self, Z: Impedances, own: Resonances, frequency: Frequencies, values: Values) -> State:
        """Return Z with every resonance bent as at the level after instead of that before."""
        softening, loss, exponent = (values[size.name] for size in SIZES)
        part = self._reached**-exponent
        law = part * softening, part * loss, exponent
        linear = self.linear if self.fit is None else self.fit.at(law)
        before, after = bent(self._drifted(linear, own), frequency, law, self.ratios)
        return np.asarray(1 / (1 / Z + np.sum(after - before, axis=1)), np.complex128), own

    def _drifted(self, linear: Resonances, own: Resonances) -> Resonances:
        """Return the resonances without amplitude, drifted like the nearest one of the recording."""
        known = self.resonances
        if own is known:
            return linear
        near = np.argmin(np.abs(linear.poles[:, None] - known.poles), axis=1)
        factor, strength = own.poles / known.poles, own.residues / known.residues
        return Resonances(linear.poles * factor[near], linear.residues * strength[near])

    @cached_property
    def _reached(self) -> float:
        """The largest amplitude of the strongest resonance at the higher level, relative to that without a bend."""
        if self.fit is None:
            return 1.0
        f, k = self.fit.both.frequency, strongest(self.linear)
        curves = self.linear.seen(f), bent(self.linear, f, self.fit.law, (0.0, 1.0))[1]
        without, with_bend = (float(np.max(np.abs(Y[:, k]) / f)) for Y in curves)
        return with_bend / without

    def _coordinates(self, law: Law) -> Reals:
        """Return the coordinates of a law."""
        softening, loss, exponent = law
        part = self._reached**exponent
        at = part * softening, part * loss, exponent
        return np.array([(value - size.median) / size.spread for value, size in zip(at, SIZES, strict=True)])


def driven(pair: Pair, own: Resonances, after: Resonances) -> AmplitudeDependent | None:
    """Return the dependence on amplitude, None without resonances.

    Levels that are not stated or equal count as if that before were none.
    """
    if not own.poles.size:
        return None
    first, second = pair.levels
    if not first or not second or first == second:
        odds = _UNKNOWN_LEVEL if first is None or second is None else _SAME_LEVEL
        return AmplitudeDependent(own, odds, (0.0, 1.0), merged(own))
    ratios = first / max(first, second), second / max(first, second)
    if second < first and not after.poles.size:
        return None
    fit = fitted_to_both(pair, (own, after), ratios)
    linear = fit.both.resonances(fit.x)
    return AmplitudeDependent(linear, _KNOWN_LEVEL, ratios, linear, fit)
