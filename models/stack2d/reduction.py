"""Fewer functions of z: those that the motion of a stack really has, and the error that leaving out the others makes.

The motion at some frequencies is sampled between axis and rim; the leading singular vectors of the samples, by elastic
and by dielectric energy, become the functions (proper orthogonal decomposition). A bare disk keeps a third of its
functions, because it moves symmetrically; a glued one two thirds. Along r nothing is reduced.
"""

import numpy as np
from scipy.special import jve

from ..base.arrays import Complexes, Frequencies, Reals
from .capacitance_slopes import capacitance
from .section import STATIC, CrossSection
from .waves import Motion, Sizes, Waves, motion

KEPT = 5e-4
"""Singular values below this part of the largest are left out; the capacitance is stationary, its error far smaller."""
_PLACES = 48
# Places between axis and rim, denser towards the rim.
_RADIAL = 10.0
# Weight of the energy of a motion that is even through the thickness: of waves about a third of a thickness long.


def reduced(
    section: CrossSection, sizes: Sizes, values: Complexes, frequency: Frequencies, kept: float = KEPT
) -> CrossSection:
    """Return the section over the functions that describe these frequencies in Hz, shape (F,).

    `values`: constants, shape (F, 11 L + 2), SI. Raises StackError.
    """
    whole = motion(Waves.of(section, sizes, values, frequency), sizes)
    (found,) = whole.parts
    elastic_u, elastic_w, dielectric = _energies(section, found)
    samples = _samples(found, whole.capacitance)
    u, size_u = _leading(samples["U"], elastic_u)
    w, size_w = _leading(samples["W"], elastic_w)
    p, size_p = _leading(samples["P"], dielectric)
    largest = max(float(size_u[0]), float(size_w[0]))
    u, w, p = u[:, size_u > kept * largest], w[:, size_w > kept * largest], p[:, size_p > kept * size_p[0]]
    return section.projected({"u": u, "w": w, "q": p})


def error(section: CrossSection, finer: CrossSection, sizes: Sizes, values: Complexes, frequency: Frequencies) -> float:
    """Return the root mean square relative difference of the capacitances of two sections at frequencies in Hz."""
    ratio = capacitance(section, sizes, values, frequency) / capacitance(finer, sizes, values, frequency)
    return float(np.sqrt(np.mean(np.abs(ratio - 1) ** 2)))


def _samples(found: Motion, capacitance: Complexes) -> dict[str, Complexes]:
    """Return the motion at places between axis and rim as columns, each weighted by the root of its area."""
    radius = found.outer.radius
    ends = radius * np.cos(np.linspace(0, np.pi / 2, _PLACES + 1))
    size = np.sqrt(np.abs(capacitance))[:, None]
    columns: dict[str, list[Complexes]] = {"U": [], "W": [], "P": []}
    for outer, inner in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
        grown = np.exp(np.abs(found.k.imag) * (outer - radius)) * np.sqrt(outer * (outer - inner))
        for name, order in (("U", 1), ("W", 0), ("P", 0)):
            along = np.asarray(jve(order, found.k * outer), np.complex128)
            there = np.einsum("fin,fn->fi", found.waves[name], along * grown)
            if order == 0:
                wide = found.wide[name] if name == "W" else found.wide[name][:, 1:]
                there = there + wide * np.sqrt(outer * (outer - inner))
            columns[name].append(there / size)
    return {name: np.concatenate(parts).T for name, parts in columns.items()}


def _energies(section: CrossSection, found: Motion) -> tuple[Reals, Reals, Reals]:
    """Return the energy of functions of u, w and q at the middle frequency, real symmetric positive."""
    middle = found.k.shape[0] // 2

    def static(left: str, right: str) -> Reals:
        block = section.blocks[left, right]
        kept = [term.frequency == STATIC for term in block.terms]
        return block.weighted(np.where(kept, found.weights[left, right][[middle]], 0.0))[0].real

    u = static("U", "U") + _RADIAL * static("E", "E")
    w = static("W", "W") + _RADIAL * static("kW", "kW")
    return u, w, -(static("P", "P")[1:, 1:] + _RADIAL * static("kP", "kP"))


def _leading(columns: Complexes, energy: Reals) -> tuple[Reals, Reals]:
    """Return functions of unit energy, shape (n, n), and the size of each in the columns, falling, shape (n,)."""
    root = np.linalg.cholesky(energy)
    both = np.hstack([columns.real, columns.imag])
    vectors, sizes, _ = np.linalg.svd(root.T @ both, full_matrices=False)
    return np.asarray(np.linalg.solve(root.T, vectors), np.float64), np.asarray(sizes, np.float64)
