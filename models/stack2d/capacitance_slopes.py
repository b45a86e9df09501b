"""Derivatives of the capacitance: the form is stationary, so that each is the value of its term at the solution.

The integrals over r of products of two waves are closed (E. von Lommel, Math. Ann. 14 (1879) 510), from values at the
rim. Every derivative therefore follows from two matrices of second moments, and costs as much as a product of matrices.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np

from ..base.arrays import Complexes, Frequencies
from .opened import OpenedSection, OpenedWaves
from .section import INERTIAL, LAYER_CONSTANTS, PERMITTIVITY, VISCOUS, CrossSection
from .waves import Motion, Rim, Sizes, Waves, WholeMotion, motion
from .zones import ZonedSection, ZonedWaves

Section: TypeAlias = CrossSection | ZonedSection
"""Functions of z of a stack, everywhere the same or part by part."""

_ALIKE = 1e-5
# Relative difference of squared wave numbers below which two waves are integrated as one: the closed form cancels.
_CHUNK = 64
# Frequencies that are solved together.
_OF_FREQUENCY = {INERTIAL: 2.0, VISCOUS: 1.0}
# Exponent of frequency in a term.


@dataclass(frozen=True, eq=False)
class StackCapacitance:
    """Capacitance in F and its derivatives."""

    capacitance: Complexes
    """Y/(jw), shape (F,)."""
    by_constant: Complexes
    """By each of the LAYER_CONSTANTS of all layers in turn and by both loads, shape (F, 11 L + 2); F per SI unit."""
    by_log_thickness: Complexes
    """F, shape (F, L)."""
    by_log_radius: Complexes
    """F, shape (F,)."""


@dataclass(frozen=True, eq=False)
class StackWaves:
    """The waves of a stack at some frequencies, from which its capacitance follows."""

    section: Section
    sizes: Sizes
    apart: tuple[int, int] | None
    """Indices of the layers that face each other where a bond may be open; None if none may."""
    chunks: tuple[Waves | OpenedWaves | ZonedWaves, ...]

    @classmethod
    def of(
        cls,
        section: Section,
        sizes: Sizes,
        values: Complexes,
        frequency: Frequencies,
        apart: tuple[int, int] | None = None,
    ) -> Self:
        """Return the waves for constants of shape (F, 11 L + 2), SI, at frequencies in Hz. Raises StackError.

        `apart` is for a whole section only.
        """
        parts = [slice(start, start + _CHUNK) for start in range(0, frequency.size, _CHUNK)]
        if isinstance(section, ZonedSection):
            zoned = tuple(ZonedWaves.of(section, sizes, values[at], frequency[at]) for at in parts)
            return cls(section, sizes, None, zoned)
        if apart is None:
            return cls(section, sizes, None, tuple(Waves.of(section, sizes, values[at], frequency[at]) for at in parts))
        opened = OpenedSection.of(section, apart)
        made = tuple(OpenedWaves.of(opened, sizes, values[at], frequency[at]) for at in parts)
        return cls(section, sizes, apart, made)

    def capacitance(self, fraction: float = 0.0) -> Complexes:
        """Return Y/(jw) in F, shape (F,), with this part of the bond open."""
        return np.concatenate([one.capacitance for one in self._motions(fraction)])

    def slopes(self, fraction: float = 0.0) -> StackCapacitance:
        """Return the same with its derivatives by all constants and sizes; the opening keeps its part of the area."""
        parts = [_slopes(self.section, self.sizes, one) for one in self._motions(fraction)]
        return StackCapacitance(
            np.concatenate([part.capacitance for part in parts]),
            np.concatenate([part.by_constant for part in parts]),
            np.concatenate([part.by_log_thickness for part in parts]),
            np.concatenate([part.by_log_radius for part in parts]),
        )

    def _motions(self, fraction: float) -> Iterator[WholeMotion]:
        for one in self.chunks:
            if isinstance(one, Waves):
                yield motion(one, self.sizes)
            elif isinstance(one, ZonedWaves):
                yield one.motion()
            else:
                yield one.motion(fraction) if fraction > 0 else motion(one.around, self.sizes)


def capacitance(section: Section, sizes: Sizes, values: Complexes, frequency: Frequencies) -> Complexes:
    """Return Y/(jw) in F, shape (F,), for constants of shape (F, 11 L + 2), SI. Raises StackError."""
    return StackWaves.of(section, sizes, values, frequency).capacitance()


def _slopes(section: Section, sizes: Sizes, found: WholeMotion) -> StackCapacitance:
    count = found.capacitance.size
    by_constant = np.zeros((count, section.layers * len(LAYER_CONSTANTS) + 2), np.complex128)
    by_thickness = np.zeros((count, section.layers), np.complex128)
    by_frequency = np.zeros(count, np.complex128)
    for part in found.parts:
        moments = _moments(part)
        for pair, block in part.section.blocks.items():
            number, *shape = block.matrices.shape
            flat = shape[0] * shape[1]
            twice = 1.0 if pair[0] == pair[1] else 2.0
            each = moments[pair].reshape(count, flat) @ block.matrices.reshape(number, flat).T
            each *= -2 * np.pi * PERMITTIVITY * sizes.unit * twice
            weighed = each * part.weights[pair]
            for k, term in enumerate(block.terms):
                by_constant[:, term.constant] += each[:, k] * part.factors[pair][:, k]
                by_thickness[:, term.layer] += term.power * weighed[:, k]
                by_frequency += _OF_FREQUENCY.get(term.frequency, 0.0) * weighed[:, k]
    # C is of the dimension of a length: the same constants at all sizes times s and frequency over s give s C
    by_radius = found.capacitance - by_thickness.sum(axis=1) + by_frequency
    return StackCapacitance(found.capacitance, by_constant, by_thickness, by_radius)


def _moments(found: Motion) -> Mapping[tuple[str, str], Complexes]:
    """Return the integral over r of the products of each pair of fields, by function of z, shape (F, n, m)."""
    k, U = found.k[:, None], found.waves["U"]
    along0, along1 = _integrals(found)

    def with_wide(name: str) -> Complexes:
        return np.concatenate([found.wide[name][:, :, None], found.waves[name]], axis=2)

    still = np.zeros((*U.shape[:2], 1))
    P = found.waves["P"]
    lift = np.zeros((P.shape[0], 1, P.shape[2]))
    first = {
        "E": np.concatenate([still, U * k], axis=2),
        "W": with_wide("W"),
        "P": np.concatenate([found.wide["P"][:, :, None], np.concatenate([lift, P], axis=1)], axis=2),
    }
    second = {"U": U, "kW": found.waves["W"] * k, "kP": P * k}
    made: dict[tuple[str, str], Complexes] = {}
    for fields, integrals in ((first, along0), (second, along1)):
        names = list(fields)
        for n, left in enumerate(names):
            by_right = fields[left] @ integrals
            for right in names[n:]:
                made[left, right] = by_right @ np.swapaxes(fields[right], 1, 2)
    at_rim = np.einsum("fun,fn->fu", U, found.outer.one)
    rim = at_rim[:, :, None] * at_rim[:, None, :]
    if found.inner is not None:
        at_rim = np.einsum("fun,fn->fu", U, found.inner.one)
        rim = rim - at_rim[:, :, None] * at_rim[:, None, :]
    made["rim", "rim"] = rim
    return made


def _integrals(found: Motion) -> tuple[Complexes, Complexes]:
    """Return the integrals of r C0 C0 over waves, the plate of infinite width first, and of r C1 C1 over waves.

    C: cylinder functions of any kind. Shapes (F, N + 1, N + 1) and (F, N, N).
    """
    outer = _up_to(found.k, found.outer)
    if found.inner is None:
        return outer
    inner = _up_to(found.k, found.inner)
    return outer[0] - inner[0], outer[1] - inner[1]


def _up_to(k: Complexes, rim: Rim) -> tuple[Complexes, Complexes]:
    """Return the antiderivatives at a rim."""
    a, count = rim.radius, k.shape[1]
    K, left, right = k[:, :, None], (rim.zero[:, :, None], rim.one[:, :, None]), (rim.zero[:, None], rim.one[:, None])
    apart = K**2 - k[:, None] ** 2
    alike = np.abs(apart) < _ALIKE * (np.abs(K) ** 2 + np.abs(k[:, None]) ** 2)
    apart[alike] = 1.0
    zero = a * (K * left[1] * right[0] - k[:, None] * left[0] * right[1]) / apart
    one = a * (k[:, None] * left[1] * right[0] - K * left[0] * right[1]) / apart
    own = a**2 / 2 * (left[0] * right[0] + left[1] * right[1])
    bent = own - a * (left[0] * right[1] + left[1] * right[0]) / (K + k[:, None])
    zero[alike], one[alike] = own[alike], bent[alike]
    whole = np.empty((k.shape[0], count + 1, count + 1), np.complex128)
    whole[:, 0, 0] = a**2 / 2
    whole[:, 1:, 0] = whole[:, 0, 1:] = a * rim.one / k
    whole[:, 1:, 1:] = zero
    return whole, one
