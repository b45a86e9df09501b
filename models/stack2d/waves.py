"""Waves along r of a section, and the motion of a disk with a free rim as their sum.

At each frequency the section has as many waves as functions of z, with wave numbers from an eigenvalue problem in k^2.
Each of them satisfies the equations of motion at every r and at both faces; so does the plate of infinite width, which
carries the volt. Their sum leaves the rim without force and charge: one linear system of the same size. The solution
is that of finite elements in z with infinitely many along r, whatever the diameter.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Self, TypeAlias

import numpy as np
from numpy.typing import NDArray
from scipy.special import hankel1e, hankel2e, jve

from ..base.arrays import Complexes, Frequencies
from ..stack.loss_laws import StackError
from .section import PAIRS, PERMITTIVITY, STIFFNESS, UNITS, CrossSection

_SHIFT = 1 + 2j
# s, a squared wave number that no wave has but by chance.

Side: TypeAlias = tuple[NDArray[np.intp], NDArray[np.intp]]
"""Functions of one side of an opening: indices among those of u, and among those of w and q together."""


@dataclass(frozen=True)
class Sizes:
    """Sizes of a stack."""

    radius: float
    """m, of all layers."""
    thicknesses: tuple[float, ...]
    """m, back to front."""
    hole: float = 0.0
    """Radius of a hole through the middle of all layers, m; 0 if there is none."""

    @property
    def unit(self) -> float:
        """Unit of length of the computation, m."""
        return sum(self.thicknesses)


@dataclass(frozen=True, eq=False)
class Rim:
    """Cylinder functions of the waves at one radius, each wave scaled so that none overflows."""

    radius: float
    """Over the unit of length."""
    zero: Complexes
    """Of order 0, shape (F, N)."""
    one: Complexes
    """Of order 1."""

    def beside(self, other: Self) -> Self:
        """Return these functions followed by others of the same waves."""
        zero, one = (
            np.concatenate([own, its], axis=1) for own, its in ((self.zero, other.zero), (self.one, other.one))
        )
        return type(self)(self.radius, zero, one)


@dataclass(frozen=True, eq=False)
class Waves:
    """The waves along r of a section, and the plate of infinite width, in units of the computation."""

    section: CrossSection
    weights: Mapping[tuple[str, str], Complexes]
    """Weights of the terms of each block, shape (F, T)."""
    factors: Mapping[tuple[str, str], Complexes]
    """Weight of each term over the value of its constant, SI, shape (F, T)."""
    made: Mapping[tuple[str, str], Complexes]
    """The form over the section's functions, shapes (F, n, m)."""
    wide: Mapping[str, Complexes]
    """Functions of the plate of infinite width: `W`, `P`, shapes (F, n)."""
    density: Complexes
    """Its capacitance per area, shape (F,)."""
    force: Complexes
    """Its force on a rim, over the functions of u, shape (F, nu)."""
    k: Complexes
    """Wave numbers, shape (F, N)."""
    U: Complexes
    """Functions of z of the waves: u_r, shape (F, nu, N)."""
    p: Complexes
    """The same of u_z and the potential together, shape (F, nw + nq, N)."""

    @classmethod
    def of(
        cls,
        section: CrossSection,
        sizes: Sizes,
        values: Complexes,
        frequency: Frequencies,
        sides: Sequence[Side] | None = None,
    ) -> Self:
        """Return the waves at frequencies in Hz, shape (F,), for constants of shape (F, 11 L + 2), SI.

        `sides`: functions that the form does not couple, if there are such: each side has waves of its own. Raises
        StackError for constants that are not finite.
        """
        if not (np.all(np.isfinite(values)) and np.all(np.isfinite(sizes.thicknesses))):
            raise StackError("stack: its constants are not all finite numbers")
        factors = _factors(section, sizes, frequency)
        weights = {
            pair: factor * values[:, [term.constant for term in section.blocks[pair].terms]]
            for pair, factor in factors.items()
        }
        made = {pair: section.blocks[pair].weighted(weights[pair]) for pair in PAIRS}
        wide = _wide(made) if section.driven else _nothing(made)
        return cls(section, weights, factors, made, *wide, *_waves(made, sides, floats=section.floats))

    @property
    def doubled(self) -> Self:
        """The same waves twice, for two kinds of cylinder functions."""
        twice = {
            name: np.concatenate([one] * 2, axis=-1) for name, one in (("k", self.k), ("U", self.U), ("p", self.p))
        }
        return replace(self, **twice)

    def with_amplitudes(self, amplitudes: Complexes, inner: Rim | None, outer: Rim) -> "Motion":
        """Return the motion between two radii with amplitudes of shape (F, N)."""
        nw, own = self.wide["W"].shape[1], amplitudes[:, None]
        waves = {"U": self.U * own, "W": self.p[:, :nw] * own, "P": self.p[:, nw:] * own}
        return Motion(self.section, self.weights, self.factors, self.wide, self.k, waves, inner, outer)

    def stresses(self, rim: Rim) -> Complexes:
        """Return force and charge of each wave on a rim, over the functions of u, w and q, shape (F, nu + nw + nq, N).

        Over the radius, as the form is.
        """
        made, U, p, k = self.made, self.U, self.p, self.k
        along0, along1 = _coupling(made)
        P2 = _square(made["kW", "kW"], made["kW", "kP"], made["kP", "kP"])
        radial = (made["E", "E"] @ (U * k[:, None]) + along0 @ p) * rim.zero[:, None]
        radial += (made["rim", "rim"] @ U) * (rim.one / rim.radius)[:, None]
        other = -(np.swapaxes(along1, 1, 2) @ U + P2 @ (p * k[:, None])) * rim.one[:, None]
        return np.concatenate([radial, other], axis=1)

    def displacements(self, rim: Rim) -> Complexes:
        """Return the functions of u, w and q of each wave at a rim, shape (F, nu + nw + nq, N)."""
        return np.concatenate([self.U * rim.one[:, None], self.p * rim.zero[:, None]], axis=1)

    @property
    def forces(self) -> Complexes:
        """Forces of the plate of infinite width on a rim, over the functions of u, w and q, shape (F, nu + nw + nq)."""
        return np.pad(self.force, ((0, 0), (0, self.p.shape[1])))

    @property
    def still(self) -> Complexes:
        """Displacements and potential of the plate of infinite width, over the same functions."""
        return np.concatenate([np.zeros_like(self.force), self.wide["W"], self.wide["P"][:, 1:]], axis=1)

    def charge(self, motion: "Motion") -> Complexes:
        """Return the charge on the electrode between the radii of a motion of these waves, shape (F,)."""
        of_E, of_W, of_P = (self.made[name, "P"][:, :, 0] for name in ("E", "W", "P"))
        wide, waves = motion.wide, motion.waves
        still = np.einsum("fi,fi->f", of_W, wide["W"]) + np.einsum("fi,fi->f", of_P, wide["P"])
        moving = np.einsum("fi,fin->fn", of_E, waves["U"]) * motion.k
        moving += np.einsum("fi,fin->fn", of_W, waves["W"]) + np.einsum("fi,fin->fn", of_P[:, 1:], waves["P"])

        def up_to(rim: Rim) -> Complexes:
            return rim.radius**2 / 2 * still + np.einsum("fn,fn->f", moving, rim.radius * rim.one / motion.k)

        whole = up_to(motion.outer)
        return -2 * np.pi * (whole if motion.inner is None else whole - up_to(motion.inner))


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of a stack for one volt between two radii at some frequencies, in units of the computation."""

    section: CrossSection
    weights: Mapping[tuple[str, str], Complexes]
    """As of `Waves`."""
    factors: Mapping[tuple[str, str], Complexes]
    """As of `Waves`."""
    wide: Mapping[str, Complexes]
    """As of `Waves`."""
    k: Complexes
    """Wave numbers, shape (F, N)."""
    waves: Mapping[str, Complexes]
    """Functions of the waves with their amplitudes: `U`, `W`, `P`, shapes (F, n, N)."""
    inner: Rim | None
    """None at the axis."""
    outer: Rim

    def rim(self, radius: float) -> Rim:
        """Return the cylinder functions at a radius between both, over the unit of length."""
        if self.inner is None:
            return standing(self.k, radius, self.outer.radius)
        k = self.k[:, : self.k.shape[1] // 2]
        return standing(k, radius, self.outer.radius).beside(decaying(k, radius, self.inner.radius))


@dataclass(frozen=True, eq=False)
class WholeMotion:
    """The motion of a whole stack for one volt."""

    capacitance: Complexes
    """Y/(jw) in F, shape (F,)."""
    parts: tuple[Motion, ...]
    """From the axis outwards."""


def _factors(section: CrossSection, sizes: Sizes, frequency: Frequencies) -> dict[tuple[str, str], Complexes]:
    """Return the weight of each term over the value of its constant in SI units, shape (F, T)."""
    w, unit = 2 * np.pi * frequency, sizes.unit
    units = np.append(np.tile(UNITS, section.layers), [STIFFNESS, STIFFNESS])
    of_frequency = np.array([np.ones(w.size, np.complex128), -((w * unit) ** 2), 1j * w * unit])
    lengths = np.array(sizes.thicknesses) / unit
    factors: dict[tuple[str, str], Complexes] = {}
    for pair, block in section.blocks.items():
        of_size = np.array([lengths[term.layer] ** float(term.power) for term in block.terms])
        of_unit = of_size / units[[term.constant for term in block.terms]]
        turning = of_frequency[[term.frequency for term in block.terms]].T
        factors[pair] = np.multiply(turning, of_unit, dtype=np.complex128)
    return factors


def motion(own: Waves, sizes: Sizes) -> WholeMotion:
    """Return the motion of a stack without a hole with these waves, free at its rim, for one volt."""
    a = sizes.radius / sizes.unit
    rim = standing(own.k, a, a)
    amplitudes = np.asarray(np.linalg.solve(own.stresses(rim), -own.forces[:, :, None])[:, :, 0], np.complex128)
    u = np.einsum("fun,fn->fu", own.U, amplitudes * rim.one)
    C = np.pi * a**2 * own.density - 2 * np.pi * a * np.einsum("fu,fu->f", u, own.force)
    return WholeMotion(C * PERMITTIVITY * sizes.unit, (own.with_amplitudes(amplitudes, None, rim),))


def standing(k: Complexes, radius: float, scaled_at: float) -> Rim:
    """Return J0 and J1 of waves at a radius, scaled by exp(-|Im k| scaled_at)."""
    grown = np.exp(np.abs(k.imag) * (radius - scaled_at))
    return Rim(radius, jve(0, k * radius) * grown, jve(1, k * radius) * grown)


def decaying(k: Complexes, radius: float, scaled_at: float) -> Rim:
    """Return the Hankel functions that decay outwards of waves at a radius, scaled by exp(|Im k| scaled_at)."""
    z, first = k * radius, k.imag >= 0
    turned = np.exp(np.where(first, 1j, -1j) * k * (radius - scaled_at))
    zero, one = (np.where(first, hankel1e(order, z), hankel2e(order, z)) * turned for order in (0, 1))
    return Rim(radius, zero, one)


def _wide(made: Mapping[tuple[str, str], Complexes]) -> tuple[dict[str, Complexes], Complexes, Complexes]:
    """Return the plate of infinite width: its functions, its capacitance per area, and the force on its rim."""
    still = _square(made["W", "W"], made["W", "P"], made["P", "P"])
    nw = made["W", "W"].shape[1]
    inner = np.array([k for k in range(still.shape[1]) if k != nw])
    column = still[:, inner, nw]
    x = np.asarray(-np.linalg.solve(still[:, inner[:, None], inner], column[:, :, None])[:, :, 0], np.complex128)
    density = -(still[:, nw, nw] + np.einsum("fi,fi->f", column, x))
    wide = {"W": x[:, :nw], "P": np.insert(x[:, nw:], 0, 1.0, axis=1)}
    force = np.einsum("fuw,fw->fu", made["E", "W"], wide["W"]) + np.einsum("fup,fp->fu", made["E", "P"], wide["P"])
    return wide, density, force


def _nothing(made: Mapping[tuple[str, str], Complexes]) -> tuple[dict[str, Complexes], Complexes, Complexes]:
    """Return the same of a plate without electrodes."""
    count, nw, n = made["W", "P"].shape
    nu = made["E", "W"].shape[1]
    of_u, of_w, of_p, density = (np.zeros((count, *own), np.complex128) for own in ((nu,), (nw,), (n,), ()))
    return {"W": of_w, "P": of_p}, density, of_u


def _square(upper: Complexes, corner: Complexes, lower: Complexes) -> Complexes:
    """Return the symmetric matrices of four blocks."""
    return np.concatenate(
        [np.concatenate([upper, corner], axis=2), np.concatenate([np.swapaxes(corner, 1, 2), lower], axis=2)], axis=1
    )


def _coupling(made: Mapping[tuple[str, str], Complexes]) -> tuple[Complexes, Complexes]:
    """Return the coupling of u_r to u_z and the potential, along J0 and along J1, shapes (F, nu, nw + nq)."""
    along0 = np.concatenate([made["E", "W"], made["E", "P"][:, :, 1:]], axis=2)
    return along0, np.concatenate([made["U", "kW"], made["U", "kP"]], axis=2)


def _waves(
    made: Mapping[tuple[str, str], Complexes], sides: Sequence[Side] | None, *, floats: bool
) -> tuple[Complexes, Complexes, Complexes]:
    """Return wave numbers, shape (F, N), and the functions U, (F, nu, N), and of W and P together, (F, nw + nq, N).

    With U = k V the problem is linear in k^2: [X R; 0 P0] + k^2 [Y 0; R^T P2] over V and the others.
    """
    X, Y = made["U", "U"], made["E", "E"]
    R = np.sum(_coupling(made), axis=0)
    P0 = _square(made["W", "W"], made["W", "P"][:, :, 1:], made["P", "P"][:, 1:, 1:])
    P2 = _square(made["kW", "kW"], made["kW", "kP"], made["kP", "kP"])
    if floats:
        return _floating(X, Y, R, P0, P2, made["W", "W"].shape[1])
    count, nu, others = R.shape
    k, U, p = (np.zeros((count, *n, nu + others), np.complex128) for n in ((), (nu,), (others,)))
    start, all_of = 0, (np.arange(nu, dtype=np.intp), np.arange(others, dtype=np.intp))
    for u, q in sides or (all_of,):
        own = slice(start, start + u.size + q.size)
        row, other = u[:, None], q[:, None]
        squared, shapes = _eigen(X[:, row, u], Y[:, row, u], R[:, row, q], P0[:, other, q], P2[:, other, q])
        k[:, own] = np.sqrt(squared)
        U[:, u, own], p[:, q, own] = shapes[:, : u.size] * k[:, None, own], shapes[:, u.size :]
        start = own.stop
    return k, U, p


def _floating(
    X: Complexes, Y: Complexes, R: Complexes, P0: Complexes, P2: Complexes, constant: int
) -> tuple[Complexes, Complexes, Complexes]:
    """Return the same where the potential is free: the waves carry no charge along r, which gives their constant.

    `constant`: its index among the others. The constant by itself, of wave number 0, is left out.
    """
    rest = np.delete(np.arange(P2.shape[1], dtype=np.intp), constant)
    alone = P2[:, constant, constant][:, None, None]
    of_u, of_rest = R[:, :, constant, None] / alone, P2[:, rest, constant, None] / alone
    by_u, by_rest = R[:, None, :, constant], P2[:, None, constant, rest]
    lesser, other = R[:, :, rest] - of_u @ by_rest, rest[:, None]
    squared, shapes = _eigen(X - of_u @ by_u, Y, lesser, P0[:, other, rest], P2[:, other, rest] - of_rest @ by_rest)
    nu, k = R.shape[1], np.sqrt(squared)
    V, p = shapes[:, :nu], shapes[:, nu:]
    own = -(by_u @ V + by_rest @ p) / alone
    whole = np.zeros((*p.shape[:1], P2.shape[1], p.shape[2]), np.complex128)
    whole[:, rest], whole[:, constant] = p, own[:, 0]
    return k, V * k[:, None], whole


def _eigen(X: Complexes, Y: Complexes, R: Complexes, P0: Complexes, P2: Complexes) -> tuple[Complexes, Complexes]:
    """Return k^2 of the waves, and V and the others as columns.

    Solved for 1/(k^2 - s): waves that travel are exact to rounding however short the shortest of thin elements are.
    """
    nu, Rt = X.shape[1], np.swapaxes(R, 1, 2)
    still = np.concatenate([np.concatenate([X, R], axis=2), np.concatenate([np.zeros_like(Rt), P0], axis=2)], axis=1)
    moving = np.zeros_like(still)
    moving[:, :nu, :nu], moving[:, nu:, :nu], moving[:, nu:, nu:] = Y, Rt, P2
    inverse, shapes = np.linalg.eig(-np.linalg.solve(still + _SHIFT * moving, moving))
    return np.asarray(_SHIFT + 1 / inverse, np.complex128), np.asarray(shapes, np.complex128)
