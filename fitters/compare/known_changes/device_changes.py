"""Changes in the device, described by its resonances: not by a model, but by the poles of the recording before.

Y before is the sum of its poles and a remainder. A change moves poles; the remainder stays the same, and cancels:

    Y after = Y before + sum over the resonances of (pole after - pole before)

If all frequencies change by one factor, the remainder is shifted over frequency as well.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import make_lsq_spline

from ....models.base.arrays import Complexes, Frequencies, Impedances, Reals
from ..change import DEVICE, ChangeSize, Values
from ..levels.drive_levels import AmplitudeDependent
from ..pair import Pair
from ..resonances import Resonances, State, changed, pole_terms, slope_of

_MOST = 8
"""Number of resonances tried as the only changed one. A budget."""
_USUAL = 0.03
_KNOT = 4
"""Points between the knots of the smoothed remainder."""
_PLACES, _QS = 160, (20.0, 60.0, 200.0)
"""Grid for the search of a new resonance."""


@dataclass(frozen=True, eq=False)
class Scaled:
    """All frequencies changed by one factor: temperature, ageing, thickness."""

    resonances: Resonances
    effect: str = "frequency-shift"
    where: str = DEVICE
    odds: float = _USUAL
    sizes: tuple[ChangeSize, ...] = (
        ChangeSize("shift", "1", 0.0, 1e-2, signed=True),
        ChangeSize("capacitance", "1", 0.0, 1e-2, signed=True),
    )
    starts: tuple[tuple[float, ...], ...] = ()

    @property
    def says(self) -> str:
        """A sentence for people."""
        return "All resonances moved by one factor: temperature, ageing, or another thickness."

    def act(self, Z: Impedances, own: Resonances, frequency: Frequencies, values: Values) -> State:
        """Return Z shifted over frequency, with a nearly unchanged static capacitance."""
        factor = float(np.exp(values["shift"]))
        rest = 1 / Z - np.sum(own.seen(frequency), axis=1)
        u = np.log(frequency)
        place = u - values["shift"]
        inside = np.clip(place, u[0], u[-1])
        outside = np.exp(place - inside)  # beyond the ends of the band, the admittance of a capacitance
        smooth = _smoothed(u, rest)
        moved = rest + smooth(inside) * outside * factor - smooth(u)
        scale = np.exp(values["capacitance"])
        now = Resonances(own.poles * factor, own.residues * factor**2 * scale)
        return 1 / (moved * scale + np.sum(now.seen(frequency), axis=1)), now


@dataclass(frozen=True, eq=False)
class Moved:
    """Some or all resonances changed: their frequency, damping or strength."""

    resonances: Resonances
    effect: str
    says: str
    sizes: tuple[ChangeSize, ...]
    which: tuple[int, ...]
    where: str = DEVICE
    odds: float = _USUAL
    starts: tuple[tuple[float, ...], ...] = ()

    def act(self, Z: Impedances, own: Resonances, frequency: Frequencies, values: Values) -> State:
        """Return Z with the poles moved."""
        chosen = list(self.which)
        p, r = own.poles[chosen], own.residues[chosen]
        shift, q, strength = (values.get(name, 0.0) for name in ("shift", "ln Q", "ln strength"))
        before = own.seen(frequency)[:, chosen]
        now = own.with_others(chosen, *changed(p, r, shift, q, strength))
        return 1 / (1 / Z + np.sum(now.seen(frequency)[:, chosen] - before, axis=1)), now


@dataclass(frozen=True, eq=False)
class NewResonance:
    """A new resonance."""

    sizes: tuple[ChangeSize, ...]
    resonances: Resonances
    scale: float
    """S, the unit of its strength."""
    starts: tuple[tuple[float, ...], ...]
    effect: str = "new-resonance"
    where: str = DEVICE
    odds: float = _USUAL
    least_q: float = 8.0
    """Below this, it would be a relaxation, or a curvature like that of a capacitance."""
    says: str = "A resonance is there that was not: a void, a crack, a layer, something that hangs on the device."

    def possible(self, frequency: Frequencies, values: Values) -> bool:
        """Return whether it is a resonance, and in the band."""
        inside = frequency[0] / 1.02 < values["frequency"] < frequency[-1] * 1.02
        return bool(inside and values["Q"] > self.least_q)

    def act(self, Z: Impedances, own: Resonances, frequency: Frequencies, values: Values) -> State:
        """Return Z in parallel with a branch of L, C and R whose peak is `strength` Q times the usual admittance."""
        f0, q = values["frequency"], values["Q"]
        detuned = frequency / f0 - f0 / frequency
        branch = values["strength"] * self.scale * q / (1 + 1j * q * detuned)
        return 1 / (1 / Z + branch), own


DeviceChange = Scaled | Moved | NewResonance | AmplitudeDependent
_SHIFT = ChangeSize("shift", "1", 0.0, 5e-3, signed=True)
_Q = ChangeSize("ln Q", "1", 0.0, 0.5, signed=True)
_STRENGTH = ChangeSize("ln strength", "1", 0.0, 0.2, signed=True)


def _smoothed(u: Reals, rest: Complexes) -> Callable[[Reals], Complexes]:
    """Return a remainder as a smooth function of ln f.

    Interpolation would average its noise, so that the change would seem to fit better than noise allows.
    """
    inner = u[_KNOT:-_KNOT:_KNOT]
    knots = np.concatenate([np.full(4, u[0]), inner, np.full(4, u[-1])])
    parts = make_lsq_spline(u, np.column_stack([rest.real, rest.imag]), knots, 3)

    def at(place: Reals) -> Complexes:
        values = np.asarray(parts(place), np.float64)
        return np.asarray(values[:, 0] + 1j * values[:, 1], np.complex128)

    return at


def device_changes(pair: Pair, own: Resonances) -> tuple[DeviceChange, ...]:
    """Return the possible changes in a device, from its resonances before; `driven` returns that by a drive level."""
    made: list[DeviceChange] = [Scaled(own), _new(pair, own)]
    every = tuple(range(own.poles.size))
    if every:
        resolved = np.flatnonzero(own.resolved(pair.frequency)).tolist()
        strongest = sorted(resolved, key=lambda k: -abs(own.residues[k] / own.poles[k].real))[:_MOST]
        damped = "All resonances are damped by another factor: losses, a load, a clamp."
        weaker = "All resonances are stronger or weaker by one factor: poling, active area."
        made += [
            Moved(own, "damping-change", damped, (_Q,), every),
            Moved(own, "coupling-change", weaker, (_STRENGTH,), every),
            *(_alone(own, k, len(strongest)) for k in strongest),
        ]
    return tuple(made)


def _alone(own: Resonances, k: int, count: int) -> Moved:
    frequency = f"{own.poles[k].imag / 1e3:.4g} kHz"
    says = f"Only the resonance at {frequency} changed: a local mass, a local damping, or a mode that couples to it."
    where = f"resonance at {frequency}"
    return Moved(own, "one-resonance", says, (_SHIFT, _Q, _STRENGTH), (k,), where, _USUAL / count)


def _new(pair: Pair, own: Resonances) -> NewResonance:
    """Return a new resonance, searched for where a narrow branch would explain most of the change."""
    f, Y = pair.frequency, 1 / pair.before
    span = float(np.log(f[-1] / f[0]))
    scale = float(np.median(np.abs(Y)))
    sizes = (
        ChangeSize("frequency", "Hz", float(np.sqrt(f[0] * f[-1])), span / 3),
        ChangeSize("Q", "1", 60.0, 1.0),
        ChangeSize("strength", "1", 1e-2, 2.0),
    )
    weight = 1 / np.hypot(1e-2, np.abs(slope_of(f, pair.before, own)[0]) * 1e-3)
    target = (1 / pair.after - Y) / Y * weight
    found: list[tuple[float, float, float, float]] = []
    for f0 in np.geomspace(float(f[0]), float(f[-1]), _PLACES).tolist():
        for q in _QS:
            pole = f0 * complex(-1 / (2 * q), np.sqrt(1 - 1 / (4 * q**2)))
            residue = np.array([scale * f0 / 2], np.complex128)
            column = pole_terms(f, np.array([pole]), residue)[:, 0] / Y * weight
            size = float(np.vdot(column, target).real / np.vdot(column, column).real)
            if size > 0:
                found.append((size**2 * float(np.vdot(column, column).real), float(f0), q, size))
    best = sorted(found, reverse=True)[:2]
    starts = tuple(
        tuple(float(np.log(v / size.median) / size.spread) for v, size in zip(values, sizes, strict=True))
        for _, *values in best
    )
    return NewResonance(sizes, own, scale, starts or ((0.0, 0.0, -3.0),))
