"""Fewer functions of z: those that the motion of a stack really has, and the error that leaving out the others makes.

The motion at some frequencies is sampled between axis and rim; the leading singular vectors of the samples, by elastic
and by dielectric energy, become the functions (proper orthogonal decomposition). A bare disk keeps a third of its
functions, because it moves symmetrically; a glued one two thirds. Along r nothing is reduced.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from .capacitance_slopes import Section, capacitance
from .joined import as_sums, whole_motion
from .section import STATIC, CrossSection
from .waves import Motion, Sizes, Waves
from .zones import ZonedSection, ZonedWaves, inherited

KEPT = 5e-4
"""Singular values below this part of the largest are left out; the capacitance is stationary, its error far smaller."""
_PLACES = 48
# Places between axis and rim, denser towards the rim.
_SAME = 1e-9
# Part of the largest energy below which a function is a sum of others.
_RADIAL = 10.0
# Weight of the energy of a motion that is even through the thickness: of waves about a third of a thickness long.


def reduced(section: Section, sizes: Sizes, values: Complexes, frequency: Frequencies, kept: float = KEPT) -> Section:
    """Return the section over the functions that describe these frequencies in Hz, shape (F,).

    `values`: constants, shape (F, 11 L + 2), SI. Raises StackError.
    """
    if isinstance(section, CrossSection):
        whole = whole_motion(Waves.of(section, sizes, values, frequency), sizes)
        return _reduced_part(section, whole.parts[0], whole.capacitance, kept, {})
    whole = ZonedWaves.of(section, sizes, values, frequency).motion()
    made: list[CrossSection] = []
    for own, part in zip(section.sections, whole.parts, strict=True):
        # outwards each part has the functions of the one within it, and further ones
        given = inherited(made[-1], own) if made else {}
        made.append(_reduced_part(own, part, whole.capacitance, kept, given))
    return ZonedSection.joining(made, section.reaches)


def error(section: Section, finer: Section, sizes: Sizes, values: Complexes, frequency: Frequencies) -> float:
    """Return the root mean square relative difference of the capacitances of two sections at frequencies in Hz."""
    ratio = capacitance(section, sizes, values, frequency) / capacitance(finer, sizes, values, frequency)
    return float(np.sqrt(np.mean(np.abs(ratio - 1) ** 2)))


def _reduced_part(
    section: CrossSection, found: Motion, capacitance: Complexes, kept: float, given: Mapping[str, Reals]
) -> CrossSection:
    """Return the section of a part over functions that its motion needs, and those `given` over its nodes."""
    samples, shapes = _samples(found, capacitance), section.shapes
    columns = {name: np.hstack([one.real, one.imag]) for name, one in samples.items()}
    u, w, q = (_Energy(own) for own in _energies(section, found))
    first = {name: [as_sums(given[name], shapes[name])] if given else [] for name in ("u", "w")}
    of_q = [as_sums(given["p"], shapes["p"][:, 1:])] if given else []
    if section.floats:
        of_q.insert(0, np.eye(shapes["p"].shape[1] - 1)[:, :1])
    largest = max(u.largest(columns["U"]), w.largest(columns["W"]))
    return section.projected(
        {
            "u": u.spanning(first["u"], columns["U"], kept * largest),
            "w": w.spanning(first["w"], columns["W"], kept * largest),
            "q": q.spanning(of_q, columns["P"], kept * q.largest(columns["P"])),
        }
    )


def _samples(found: Motion, capacitance: Complexes) -> dict[str, Complexes]:
    """Return the motion at places between both radii as columns, each weighted by the root of its area."""
    radius, start = found.outer.radius, 0.0 if found.inner is None else found.inner.radius
    # denser towards a radius where something ends
    turn = np.linspace(np.pi / 2 if found.inner is None else np.pi, 0.0, _PLACES + 1)
    part = np.cos(turn) if found.inner is None else (1 + np.cos(turn)) / 2
    ends = start + (radius - start) * part
    size = np.sqrt(np.abs(capacitance))[:, None]
    columns: dict[str, list[Complexes]] = {"U": [], "W": [], "P": []}
    for inner, outer in pairwise(ends.tolist()):
        rim, area = found.rim(outer), np.sqrt(outer * (outer - inner))
        for name, along in (("U", rim.one), ("W", rim.zero), ("P", rim.zero)):
            there = np.einsum("fin,fn->fi", found.waves[name], along * area)
            if name != "U":
                wide = found.wide[name] if name == "W" else found.wide[name][:, 1:]
                there = there + wide * area
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


class _Energy:
    """Functions of one kind, measured by their energy."""

    def __init__(self, energy: Reals) -> None:
        """`energy`: real symmetric positive, shape (n, n)."""
        self._root = np.linalg.cholesky(energy)

    def largest(self, columns: Reals) -> float:
        """Return the largest singular value of functions, columns of shape (n, N)."""
        return float(np.linalg.norm(self._root.T @ columns, 2)) if columns.size else 0.0

    def spanning(self, given: Sequence[Reals], columns: Reals, least: float) -> Reals:
        """Return functions of unit energy, shape (n, m), that span those `given`, one group after the other.

        Further ones describe what these leave of `columns`: its singular vectors, of values above `least`.
        """
        made = np.zeros((len(self._root), 0))
        for group, limit in (*((one, None) for one in given), (columns, least)):
            left = self._root.T @ group
            left = left - made @ (made.T @ left)
            if not left.size:
                continue
            vectors, sizes, _ = np.linalg.svd(left, full_matrices=False)
            made = np.hstack([made, vectors[:, sizes > (_SAME * sizes[0] if limit is None else limit)]])
        return np.asarray(np.linalg.solve(self._root.T, made), np.float64)
