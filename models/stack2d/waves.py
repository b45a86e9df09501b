"""Waves along r of a section, and the motion of a disk with a free rim as their sum.

At each frequency the section has as many waves as functions of z, with wave numbers from an eigenvalue problem in k^2.
Each of them satisfies the equations of motion at every r and at both faces; so does the plate of infinite width, which
carries the volt. Their sum leaves the rim without force and charge: one linear system of the same size. The solution
is that of finite elements in z with infinitely many along r, whatever the diameter.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import jve

from ..base.arrays import Complexes, Frequencies
from ..stack.loss_laws import StackError
from .section import PAIRS, PERMITTIVITY, STIFFNESS, UNITS, CrossSection


@dataclass(frozen=True)
class Sizes:
    """Sizes of a stack."""

    radius: float
    """m, of all layers."""
    thicknesses: tuple[float, ...]
    """m, back to front."""

    @property
    def unit(self) -> float:
        """Unit of length of the computation, m."""
        return sum(self.thicknesses)


@dataclass(frozen=True, eq=False)
class Motion:
    """The motion of a stack for one volt at some frequencies, in units of the computation."""

    capacitance: Complexes
    """Y/(jw) in F, shape (F,)."""
    weights: Mapping[tuple[str, str], Complexes]
    """Weights of the terms of each block, shape (F, T)."""
    factors: Mapping[tuple[str, str], Complexes]
    """Weight of each term over the value of its constant, SI, shape (F, T)."""
    wide: Mapping[str, Complexes]
    """Functions of the plate of infinite width: `W`, `P`, shapes (F, n)."""
    k: Complexes
    """Wave numbers, shape (F, N)."""
    waves: Mapping[str, Complexes]
    """Functions of the waves with their amplitudes: `U`, `W`, `P`, shapes (F, n, N)."""
    J0: Complexes
    """J0(k radius), shape (F, N), each wave scaled by exp(-|Im k radius|)."""
    J1: Complexes
    """J1 of the same."""
    radius: float
    """Radius over the unit of length."""


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


def motion(section: CrossSection, sizes: Sizes, values: Complexes, frequency: Frequencies) -> Motion:
    """Return the motion at frequencies in Hz, shape (F,), for constants of shape (F, 11 L + 2), SI.

    Raises StackError for constants that are not finite.
    """
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(sizes.thicknesses))):
        raise StackError("stack: its constants are not all finite numbers")
    factors = _factors(section, sizes, frequency)
    weights = {
        pair: factor * values[:, [term.constant for term in section.blocks[pair].terms]]
        for pair, factor in factors.items()
    }
    made = {pair: section.blocks[pair].weighted(weights[pair]) for pair in PAIRS}
    wide, density, force = _wide(made)
    k, U, p = _waves(made)
    a = sizes.radius / sizes.unit
    J0, J1 = jve(0, k * a), jve(1, k * a)
    forces = _rim_forces(made, k, U, p, J0, J1, a)
    right = np.zeros(forces.shape[:2], np.complex128)
    right[:, : U.shape[1]] = -force
    amplitudes = np.linalg.solve(forces, right[:, :, None])[:, :, 0]
    rim = np.einsum("fun,fn->fu", U, amplitudes * J1)
    C = np.pi * a**2 * density - 2 * np.pi * a * np.einsum("fu,fu->f", rim, force)
    nw = wide["W"].shape[1]
    waves = {"U": U * amplitudes[:, None], "W": p[:, :nw] * amplitudes[:, None], "P": p[:, nw:] * amplitudes[:, None]}
    return Motion(C * PERMITTIVITY * sizes.unit, weights, factors, wide, k, waves, J0, J1, a)


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


def _square(upper: Complexes, corner: Complexes, lower: Complexes) -> Complexes:
    """Return the symmetric matrices of four blocks."""
    return np.concatenate(
        [np.concatenate([upper, corner], axis=2), np.concatenate([np.swapaxes(corner, 1, 2), lower], axis=2)], axis=1
    )


def _coupling(made: Mapping[tuple[str, str], Complexes]) -> tuple[Complexes, Complexes]:
    """Return the coupling of u_r to u_z and the potential, along J0 and along J1, shapes (F, nu, nw + nq)."""
    along0 = np.concatenate([made["E", "W"], made["E", "P"][:, :, 1:]], axis=2)
    return along0, np.concatenate([made["U", "kW"], made["U", "kP"]], axis=2)


def _waves(made: Mapping[tuple[str, str], Complexes]) -> tuple[Complexes, Complexes, Complexes]:
    """Return wave numbers, shape (F, N), and the functions U, (F, nu, N), and of W and P together, (F, nw + nq, N).

    With U = k V the problem is linear in k^2: [X R; 0 P0] + k^2 [Y 0; R^T P2] over V and the others.
    """
    X, Y = made["U", "U"], made["E", "E"]
    R = np.sum(_coupling(made), axis=0)
    P0 = _square(made["W", "W"], made["W", "P"][:, :, 1:], made["P", "P"][:, 1:, 1:])
    P2 = _square(made["kW", "kW"], made["kW", "kP"], made["kP", "kP"])
    nu = X.shape[1]
    # by blocks: Y^-1 [X R], then P2^-1 of what is left
    upper = np.linalg.solve(Y, np.concatenate([X, R], axis=2))
    Rt = np.swapaxes(R, 1, 2)
    lower = -Rt @ upper
    lower[:, :, nu:] += P0
    lower = np.linalg.solve(P2, lower)
    squared, shapes = np.linalg.eig(-np.concatenate([upper, lower], axis=1))
    k = np.sqrt(squared)
    return k, shapes[:, :nu] * k[:, None], shapes[:, nu:]


def _rim_forces(
    made: Mapping[tuple[str, str], Complexes],
    k: Complexes,
    U: Complexes,
    p: Complexes,
    J0: Complexes,
    J1: Complexes,
    a: float,
) -> Complexes:
    """Return force and charge on the rim of each wave, over the functions of u, w and q, shape (F, N, N)."""
    along0, along1 = _coupling(made)
    P2 = _square(made["kW", "kW"], made["kW", "kP"], made["kP", "kP"])
    radial = (made["E", "E"] @ (U * k[:, None]) + along0 @ p) * J0[:, None] + (made["rim", "rim"] @ U) * (J1 / a)[
        :, None
    ]
    other = -(np.swapaxes(along1, 1, 2) @ U + P2 @ (p * k[:, None])) * J1[:, None]
    return np.concatenate([radial, other], axis=1)
