"""Derivatives of the capacitance: the form is stationary, so that each is the value of its term at the solution.

The integrals over r of products of two waves are closed (E. von Lommel, Math. Ann. 14 (1879) 510), from values at the
rim. Every derivative therefore follows from two matrices of second moments, and costs as much as a product of matrices.
"""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Self, TypeAlias

import numpy as np

from ..base.arrays import Complexes, Frequencies
from .joined import whole_motion
from .opened import OpenedSection, OpenedWaves
from .section import INERTIAL, LAYER_CONSTANTS, PERMITTIVITY, VISCOUS, CrossSection
from .waves import Motion, Rim, Sizes, Waves, WholeMotion
from .zones import ZonedSection, ZonedWaves

Section: TypeAlias = CrossSection | ZonedSection
"""Functions of z of a stack, everywhere the same or part by part."""

_ALIKE = 1e-5
# Relative difference of squared wave numbers below which two waves are integrated as one: the closed form cancels.
_CHUNK = 64
# Frequencies that are solved together.
_NONE: Complexes = np.zeros(1, np.complex128)
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
    """F, shape (F,); with it grow the radii of electrodes and layers, but not that of a hole."""


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
                yield whole_motion(one, self.sizes)
            elif isinstance(one, ZonedWaves):
                yield one.motion()
            else:
                yield one.motion(fraction) if fraction > 0 else whole_motion(one.around, self.sizes)


def capacitance(section: Section, sizes: Sizes, values: Complexes, frequency: Frequencies) -> Complexes:
    """Return Y/(jw) in F, shape (F,), for constants of shape (F, 11 L + 2), SI. Raises StackError."""
    return StackWaves.of(section, sizes, values, frequency).capacitance()


def _slopes(section: Section, sizes: Sizes, found: WholeMotion) -> StackCapacitance:
    count = found.capacitance.size
    by_constant = np.zeros((count, section.layers * len(LAYER_CONSTANTS) + 2), np.complex128)
    by_thickness = np.zeros((count, section.layers), np.complex128)
    by_frequency = np.zeros(count, np.complex128)
    for part in found.parts:
        for pair, each in _by_weight(part, _moments(part), sizes):
            weighed = each * part.weights[pair]
            for k, term in enumerate(part.section.blocks[pair].terms):
                by_constant[:, term.constant] += each[:, k] * part.factors[pair][:, k]
                by_thickness[:, term.layer] += term.power * weighed[:, k]
                by_frequency += _OF_FREQUENCY.get(term.frequency, 0.0) * weighed[:, k]
    # C is of the dimension of a length: the same constants at all sizes times s and frequency over s give s C
    by_radius = found.capacitance - by_thickness.sum(axis=1) + by_frequency
    hole = found.parts[0].inner
    if hole is not None:
        by_radius = by_radius - _by_log_hole(found.parts[0], hole, sizes)
    return StackCapacitance(found.capacitance, by_constant, by_thickness, by_radius)


def _by_log_hole(found: Motion, hole: Rim, sizes: Sizes) -> Complexes:
    """Return the derivative of the capacitance by the logarithm of the hole's radius, F, shape (F,).

    The form is stationary and the rim is free, so that it is the form's value there, and the hole takes it away.
    """
    radius, moments = hole.radius, dict[tuple[str, str], Complexes]()
    first, second = _fields(found)
    for fields, along in ((first, np.pad(hole.zero, ((0, 0), (1, 0)), constant_values=1.0)), (second, hole.one)):
        there = {name: _at(field, along) for name, field in fields.items()}
        for n, left in enumerate(there):
            for right in list(there)[n:]:
                moments[left, right] = -radius * there[left][:, :, None] * there[right][:, None, :]
    u, divergence = (_at(found.waves["U"], hole.one), _at(found.waves["U"] * found.k[:, None], hole.zero))
    product = u[:, :, None] * (divergence - u / radius)[:, None, :]  # u_r and its slope along r
    moments["rim", "rim"] = -(product + np.swapaxes(product, 1, 2))
    each = (np.sum(own * found.weights[pair], axis=1) for pair, own in _by_weight(found, moments, sizes))
    return np.asarray(radius * sum(each, _NONE), np.complex128)


def _by_weight(
    found: Motion, moments: Mapping[tuple[str, str], Complexes], sizes: Sizes
) -> Iterator[tuple[tuple[str, str], Complexes]]:
    """Return the capacitance in F over the weight of each term, shape (F, T), for each pair of fields."""
    for pair, block in found.section.blocks.items():
        number, *shape = block.matrices.shape
        flat = shape[0] * shape[1]
        twice = 1.0 if pair[0] == pair[1] else 2.0
        each = moments[pair].reshape(-1, flat) @ block.matrices.reshape(number, flat).T
        each *= -2 * np.pi * PERMITTIVITY * sizes.unit * twice
        yield pair, each


def _moments(found: Motion) -> Mapping[tuple[str, str], Complexes]:
    """Return the integral over r of the products of each pair of fields, by function of z, shape (F, n, m)."""
    along0, along1 = _integrals(found)
    made: dict[tuple[str, str], Complexes] = {}
    for fields, integrals in zip(_fields(found), (along0, along1), strict=True):
        names = list(fields)
        for n, left in enumerate(names):
            by_right = fields[left] @ integrals
            for right in names[n:]:
                made[left, right] = by_right @ np.swapaxes(fields[right], 1, 2)
    rim = _squared(_at(found.waves["U"], found.outer.one))
    made["rim", "rim"] = rim if found.inner is None else rim - _squared(_at(found.waves["U"], found.inner.one))
    return made


def _fields(found: Motion) -> tuple[dict[str, Complexes], dict[str, Complexes]]:
    """Return the fields along J0, of the plate of infinite width and the waves, and those along J1, of the waves."""
    k, U = found.k[:, None], found.waves["U"]

    def with_wide(name: str) -> Complexes:
        return np.concatenate([found.wide[name][:, :, None], found.waves[name]], axis=2)

    still = np.zeros((*U.shape[:2], 1), np.complex128)
    P = found.waves["P"]
    lift = np.zeros((P.shape[0], 1, P.shape[2]), np.complex128)
    first = {
        "E": np.concatenate([still, U * k], axis=2),
        "W": with_wide("W"),
        "P": np.concatenate([found.wide["P"][:, :, None], np.concatenate([lift, P], axis=1)], axis=2),
    }
    second = {"U": U, "kW": found.waves["W"] * k, "kP": P * k}
    return first, second


def _at(fields: Complexes, along: Complexes) -> Complexes:
    """Return fields of shape (F, n, N) with their waves' values at a radius, shape (F, n)."""
    return np.einsum("fin,fn->fi", fields, along)


def _squared(field: Complexes) -> Complexes:
    """Return the products of a field's functions of z, shape (F, n, n)."""
    return field[:, :, None] * field[:, None, :]


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
