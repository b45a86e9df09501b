"""Visibility of a plant: how much of it remains after constants, instrument and fixture have imitated it best.

No code of the diagnosis is used. A world without the plant is fitted to noise-free recordings of the world with it, by
least squares. Free are all constants that a fitter frees, the sizes of all other effects and of the device's
imperfections, a smooth gain and phase of the instrument and the fixture's residuals, each within its uncertainty. The
fit has two results:

- `gain`: the remaining chi2 against the noise, including the penalties for using the allowances of instrument and
  fixture;
- `moves`: the smallest root mean square difference in ln Z (no unit) that constants and other sizes can reach, with
  equal weights of all points and without instrument and fixture.

An effect that instrument and fixture alone could imitate has `moves` above zero but no `gain`.
"""

from collections.abc import Sequence
from copy import copy
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import OptimizeResult, least_squares

from ...waves import Complexes, Reals
from ..devices.specimen import AIR, LabLayer
from ..recording import ErringAnalyzer, LabSweep, shown
from .plant import LabScenario, LabWorld, Plant

_POINTS = 100
"""Number of points of a sweep that are used."""
_PARTS = 8
"""Number of parts in which a plant is taken away: each shifts a resonance by less than its width."""
_ROUNDS, _FEW_ROUNDS = 30, 3
"""Largest number of steps of a fit, and of one that leads to the next."""
_SETTLED = 1e-3
"""Relative decrease of the squared residuals at which a fit ends."""
_SHIFTED = 0.1
"""Root mean square of ln Z from which a resonance may be shifted by its width."""
FINDABLE_GAIN = 30.0
"""chi2 gain that a plant needs: noise reaches it with one free size in 4 of 10^8 recordings, with five in 1 of 10^5."""
_STEP = 1e-6
_SMALL = 3e-3
"""Root mean square of ln Z below which the linearised problem is sufficient."""
_EXACT = 1e-8
"""Relative uncertainty below which a value of the build is held."""
_COSINES = 8
ACCURACY = 1e-3
"""Relative gain and phase in rad that the analyzer's specification allows, root mean square over the band."""
_FIXTURE = (1e-9, 1e-2, 5e-3, 20e-15, 3e-9)
"""Residuals after compensation, one standard deviation each: H, ohm, ohm at 1 MHz (skin), F, S."""
_BACKED = 1e6
"""Rayl from which a load is a backing."""


@dataclass(frozen=True)
class Seen:
    """Visibility of one plant."""

    gain: float
    moves: float


@dataclass(frozen=True, eq=False)
class _Thin:
    sweep: LabSweep
    target: Complexes
    """ln Z of the true world."""
    sigma: float
    """Noise per used point: smaller where one point represents many."""


class View:
    """The recordings of one world in a session, and what constants, instrument and other sizes can imitate."""

    def __init__(self, scenario: LabScenario, sweeps: Sequence[LabSweep], analyzer: ErringAnalyzer) -> None:
        self.scenario = scenario
        self._thin = [_thinned(scenario, sweep, analyzer) for sweep in sweeps]
        self._free = _Free(scenario, None)
        A = np.concatenate([_allowances(one, analyzer) for one in self._thin])
        self._U, s, _ = np.linalg.svd(A, full_matrices=False)
        self._half = 1 - 1 / np.sqrt(1 + s**2)
        self._sigmas = np.concatenate([np.full(2 * one.target.size, one.sigma) for one in self._thin])
        self._typical = float(np.sqrt(np.mean(self._sigmas**2)))
        self._slopes: Reals | None = None
        self._seen: dict[int, Seen] = {}

    def with_rival(self, rival: Plant) -> "View":
        """Return the same with another effect that may imitate; its scale is free, starting at 0."""
        other = copy(self)
        other.join(rival)
        return other

    def join(self, rival: Plant) -> None:
        """Add another effect that may imitate."""
        self._seen = {}
        slopes = self._derivatives()
        self._free = _Free(self.scenario, rival)
        last = self._derivatives_of(np.zeros(self._free.size), None, [self._free.size - 1])
        self._slopes = np.column_stack([slopes, last[:, -1]])

    def seen(self, index: int) -> Seen:
        """Return the visibility of a plant."""
        if index not in self._seen:
            self._seen[index] = self._seen_anew(index)
        return self._seen[index]

    def _seen_anew(self, index: int) -> Seen:
        r = self._rows(self._free.moved(np.zeros(self._free.size), index))
        if self._moves(r) < _SMALL:  # small enough for the problem to be linear
            slopes = self._without(index, self._derivatives())
            x = self._linear(slopes, r)
            return Seen(self._cost(r + slopes @ x, x), self._moves(self._projected(r + slopes @ x, slopes)))
        end = self._imitated(index)
        even = self._fit(end.x, index, 0.0, _ROUNDS, even=True)
        return Seen(2 * float(end.cost), self._moves(self._rows(self._free.moved(even.x, index))))

    def _imitated(self, index: int) -> OptimizeResult:
        """Return the fit that imitates a plant best.

        A resonance that an effect shifts by more than its width is not found again in one go. The plant is therefore
        also taken away in parts, each so small that the fit can follow.
        """
        plant, x = self.scenario.plants[index], np.zeros(self._free.size)
        shifts = self._moves(self._rows(self._free.moved(x, index))) > _SHIFTED
        if not shifts or plant.least >= plant.most:  # some plants are there or not
            return self._fit(x, index, 0.0, _FEW_ROUNDS if plant.minor else _ROUNDS)
        at_once = self._fit(x, index, 0.0, _FEW_ROUNDS)
        if 2 * at_once.cost < FINDABLE_GAIN:
            return at_once
        for part in range(1, _PARTS):
            x = self._fit(x, index, 1 - part / _PARTS, _FEW_ROUNDS).x
        followed = self._fit(x, index, 0.0, _ROUNDS)
        return followed if followed.cost < at_once.cost else self._fit(at_once.x, index, 0.0, _ROUNDS)

    def _fit(self, x: Reals, index: int, rest: float, rounds: int, *, even: bool = False) -> OptimizeResult:
        """Fit the world with `rest` of a plant to the recordings, beginning at x.

        `even`: with equal weights of all points, without instrument and fixture.
        """

        def weighted(v: Reals) -> Reals:
            return v * (self._sigmas / self._typical).reshape(-1, *[1] * (v.ndim - 1)) if even else self._whiten(v)

        def residuals(x: Reals) -> Reals:
            r = self._rows(self._free.moved(x, index, rest))
            return np.concatenate([weighted(r), x / self._free.prior])

        def slopes(x: Reals) -> Reals:
            W = weighted(self._without(index, self._derivatives_at(x, index, rest)))
            return np.vstack([W, np.diag(1 / self._free.prior)])

        return least_squares(residuals, x, slopes, method="lm", x_scale="jac", ftol=_SETTLED, max_nfev=rounds)

    def _rows(self, here: LabScenario, linear: bool = False) -> Reals:
        """Return the differences from the true world over the noise; `linear`: without strain feedback."""
        out: list[Reals] = []
        for one in self._thin:
            world = here.world(one.sweep.step)
            flaws = replace(world.flaws, softening=None, settling=0.0) if linear else world.flaws
            z = shown(world.specimen, flaws, one.sweep, world.fixture)
            out.append(_real(_difference(z, one.target)) / one.sigma)
        return np.concatenate(out)

    def _derivatives(self) -> Reals:
        if self._slopes is None:
            self._slopes = self._derivatives_at(np.zeros(self._free.size), None)
        return self._slopes

    def _derivatives_at(self, x: Reals, index: int | None, rest: float = 0.0) -> Reals:
        return self._derivatives_of(x, index, [k for k in range(x.size) if self._free.prior[k] > _EXACT], rest)

    def _derivatives_of(self, x: Reals, index: int | None, of: Sequence[int], rest: float = 0.0) -> Reals:
        """Return the derivatives for some columns, zero for others; strain feedback is included for sizes only."""
        slopes = np.zeros((self._sigmas.size, x.size))
        for full in (False, True):
            some = [k for k in of if (k >= self._free.constants) == full]
            at = self._rows(self._free.moved(x, index, rest), not full) if some else 0.0
            for k in some:
                moved = x + _STEP * (np.arange(x.size) == k)
                slopes[:, k] = (self._rows(self._free.moved(moved, index, rest), not full) - at) / _STEP
        return np.nan_to_num(slopes)  # a size at 0 may have no derivative

    def _without(self, index: int, slopes: Reals) -> Reals:
        """Return derivatives without those by the size of a plant, which shall not imitate itself."""
        return slopes * [not self._free.is_plant(k, index) for k in range(self._free.size)]

    def _linear(self, slopes: Reals, r: Reals) -> Reals:
        """Return what imitates best what changes little."""
        known = 1 / self._free.prior
        W = self._whiten(slopes)
        scale = np.sqrt(np.sum(W**2, axis=0) + known**2) + 1e-12
        M = np.vstack([W / scale, np.diag(known / scale), 1e-5 * np.eye(known.size)])
        return np.linalg.lstsq(M, -np.concatenate([self._whiten(r), np.zeros(2 * known.size)]), rcond=None)[0] / scale

    def _projected(self, r: Reals, slopes: Reals) -> Reals:
        """Return the residual of rows after a least-squares fit of constants and other sizes with equal weights."""
        W = slopes * self._sigmas[:, None]
        width = np.maximum(np.linalg.norm(W, axis=0), 1e-12)
        known = np.minimum(1 / (self._free.prior * width), 1e6) * self._typical
        M = np.vstack([W / width, np.diag(known)])
        v = r * self._sigmas
        x = np.linalg.lstsq(M, -np.concatenate([v, np.zeros(known.size)]), rcond=1e-9)[0]
        return r + (W / width) @ x / self._sigmas

    def _whiten(self, v: Reals) -> Reals:
        half = self._half if v.ndim == 1 else self._half[:, None]
        return v - self._U @ (half * (self._U.T @ v))

    def _cost(self, r: Reals, x: Reals) -> float:
        return float(np.sum(self._whiten(r) ** 2) + np.sum((x / self._free.prior) ** 2))

    def _moves(self, r: Reals) -> float:
        return float(np.sqrt(2 * np.mean((r * self._sigmas) ** 2)))


class _Free:
    """The constants that a fitter frees, as relative changes or logarithms, and the sizes of the effects."""

    def __init__(self, scenario: LabScenario, rival: Plant | None) -> None:
        self.whole, self.rival = scenario, rival
        self.sizes = [k for k, p in enumerate(scenario.plants) if p.least < p.most and p.scale]
        specimen = scenario.bare.specimen
        self.layers = [layer for layer in specimen.layers if layer.name not in scenario.untold]
        prior = [np.inf] * 6 + [1.0 if specimen.back < _BACKED else 1e-9, 1.0]
        for layer in self.layers:
            prior += [max(u / v, 1e-9) for u, v in zip(layer.u, layer.told, strict=True)]
        self.constants = len(prior)
        prior += [scenario.plants[k].usual if scenario.plants[k].minor else np.inf for k in self.sizes]
        self.prior: Reals = np.array(prior + [np.inf] * (rival is not None))
        self.size = self.prior.size
        self._farthest: Reals = np.full(self.size, 1e4)
        self._farthest[:6] = 0.5
        self._farthest[8 : self.constants] = 5.0
        at = slice(self.constants, self.constants + len(self.sizes))
        plants = [scenario.plants[k] for k in self.sizes]
        self._farthest[at] = [5 * plant.usual if plant.minor else 5.0 for plant in plants]

    def is_plant(self, column: int, index: int) -> bool:
        """Return whether a column is the size of plant `index`."""
        at = column - self.constants
        return 0 <= at < len(self.sizes) and self.sizes[at] == index

    def moved(self, x: Reals, index: int | None, rest: float = 0.0) -> LabScenario:
        """Return the world moved by x, and with no more than this `rest` of plant `index`."""
        x = np.clip(x, -self._farthest, self._farthest)
        specimen = self.whole.bare.specimen
        ceramic = specimen.ceramic
        ceramic = replace(
            ceramic,
            c33D=ceramic.c33D * (1 + complex(x[0], x[1])),
            h33=ceramic.h33 * (1 + complex(x[2], x[3])),
            eps33S=ceramic.eps33S * (1 + complex(x[4], x[5])),
        )
        back, front = (
            max(load + AIR * c, 0.0) for load, c in zip((specimen.back, specimen.front), x[6:8], strict=True)
        )
        moved = {layer.name: _moved(layer, x[8 + 4 * k : 12 + 4 * k]) for k, layer in enumerate(self.layers)}
        layers = tuple(moved.get(layer.name, layer) for layer in specimen.layers)
        specimen = replace(specimen, ceramic=ceramic, layers=layers, back=back, front=front)
        bare: LabWorld = replace(self.whole.bare, specimen=specimen)
        plants = list(self.whole.plants)
        for k, change in zip(self.sizes, x[self.constants :], strict=False):
            # a loss may fall as well as rise with frequency, but nothing else is less than none
            grown = 1 + float(change) if plants[k].minor else float(np.exp(change))
            plants[k] = replace(plants[k], scale=plants[k].scale * grown)
        if index is not None:
            plants[index] = replace(plants[index], scale=rest * plants[index].scale)
        if self.rival is not None:
            plants.append(replace(self.rival, scale=float(x[-1])))
        return LabScenario(bare, tuple(plants))


def _moved(layer: LabLayer, x: Reals) -> LabLayer:
    t, z, c, q = (float(np.exp(one)) for one in x)
    return replace(layer, thickness=layer.thickness * t, z=layer.z * z, c=layer.c * c, q=layer.q * q)


def _thinned(scenario: LabScenario, sweep: LabSweep, analyzer: ErringAnalyzer) -> _Thin:
    n = sweep.frequency.size
    keep = np.unique(np.linspace(0, n - 1, min(n, _POINTS)).round().astype(int))
    few = replace(sweep, frequency=sweep.frequency[keep])
    world = scenario.world(sweep.step)
    target = np.log(shown(world.specimen, world.flaws, few, world.fixture))
    # neighbours are correlated in coloured noise: smooth curves depend on its low frequencies only
    coloured = np.sqrt((1 + analyzer.colour) / (1 - analyzer.colour))
    return _Thin(few, target, analyzer.noise * float(coloured * np.sqrt(keep.size / n)))


def _allowances(one: _Thin, analyzer: ErringAnalyzer) -> Reals:
    """Return the rows' derivatives by instrument and fixture, each a unit normal; shape (2 N, 2 cosines + 5)."""
    f, z = one.sweep.frequency, np.exp(one.target)
    u = np.log(f / analyzer.band[0]) / np.log(analyzer.band[1] / analyzer.band[0])
    basis = np.stack([np.cos(n * np.pi * u) / (1 + n) for n in range(_COSINES)], axis=1)
    gain = ACCURACY * basis.astype(np.complex128)
    omega = 2 * np.pi * f
    L, R, skin, C, G = _FIXTURE
    fixture = np.stack(
        [1j * omega * L / z, R / z, skin * (1 + 1j) * np.sqrt(f / 1e6) / z, -1j * omega * C * z, -G * z], axis=1
    )
    return _real(np.asarray(np.hstack([gain, 1j * gain, fixture]), np.complex128)) / one.sigma


def _real(z: Complexes) -> Reals:
    return np.concatenate([z.real, z.imag])


def _difference(z: Complexes, target: Complexes) -> Complexes:
    d = np.log(z) - target
    return np.asarray(d.real + 1j * ((d.imag + np.pi) % (2 * np.pi) - np.pi), np.complex128)
