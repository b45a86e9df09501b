"""Derivatives of the capacitance: the form is stationary, so that each is the value of its term at the solution.

The integrals over r of products of two waves are closed (E. von Lommel, Math. Ann. 14 (1879) 510), from values at the
rim. Every derivative therefore follows from two matrices of second moments, and costs as much as a product of matrices.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..base.arrays import Complexes, Frequencies
from .section import INERTIAL, LAYER_CONSTANTS, PERMITTIVITY, VISCOUS, CrossSection
from .waves import Motion, Sizes, motion

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


def capacitance(section: CrossSection, sizes: Sizes, values: Complexes, frequency: Frequencies) -> Complexes:
    """Return Y/(jw) in F, shape (F,), for constants of shape (F, 11 L + 2), SI. Raises StackError."""
    made = np.empty(frequency.size, np.complex128)
    for at in _chunks(frequency.size):
        made[at] = motion(section, sizes, values[at], frequency[at]).capacitance
    return made


def slopes(section: CrossSection, sizes: Sizes, values: Complexes, frequency: Frequencies) -> StackCapacitance:
    """Return the same with its derivatives by all constants and sizes. Raises StackError."""
    parts = [
        _slopes(section, sizes, motion(section, sizes, values[at], frequency[at])) for at in _chunks(frequency.size)
    ]
    return StackCapacitance(
        np.concatenate([part.capacitance for part in parts]),
        np.concatenate([part.by_constant for part in parts]),
        np.concatenate([part.by_log_thickness for part in parts]),
        np.concatenate([part.by_log_radius for part in parts]),
    )


def _chunks(count: int) -> list[slice]:
    return [slice(start, start + _CHUNK) for start in range(0, count, _CHUNK)]


def _slopes(section: CrossSection, sizes: Sizes, found: Motion) -> StackCapacitance:
    count, moments = found.capacitance.size, _moments(found)
    by_constant = np.zeros((count, section.layers * len(LAYER_CONSTANTS) + 2), np.complex128)
    by_thickness = np.zeros((count, section.layers), np.complex128)
    by_frequency = np.zeros(count, np.complex128)
    for pair, block in section.blocks.items():
        number, *shape = block.matrices.shape
        flat = shape[0] * shape[1]
        twice = 1.0 if pair[0] == pair[1] else 2.0
        each = moments[pair].reshape(count, flat) @ block.matrices.reshape(number, flat).T
        each *= -2 * np.pi * PERMITTIVITY * sizes.unit * twice
        weighed = each * found.weights[pair]
        for k, term in enumerate(block.terms):
            by_constant[:, term.constant] += each[:, k] * found.factors[pair][:, k]
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
    rim = np.einsum("fun,fn->fu", U, found.J1)
    made["rim", "rim"] = rim[:, :, None] * rim[:, None, :]
    return made


def _integrals(found: Motion) -> tuple[Complexes, Complexes]:
    """Return the integrals of r J0 J0 over waves, the plate of infinite width first, and of r J1 J1 over waves.

    Shapes (F, N + 1, N + 1) and (F, N, N).
    """
    k, J0, J1, a = found.k, found.J0, found.J1, found.radius
    K, count = np.swapaxes(k[:, None], 1, 2), k.shape[1]
    apart = K**2 - k[:, None] ** 2
    alike = np.abs(apart) < _ALIKE * (np.abs(K) ** 2 + np.abs(k[:, None]) ** 2)
    apart[alike] = 1.0
    j0, j1 = J0[:, :, None], J1[:, :, None]
    zero = a * (K * j1 * J0[:, None] - k[:, None] * j0 * J1[:, None]) / apart
    one = a * (k[:, None] * j1 * J0[:, None] - K * j0 * J1[:, None]) / apart
    own = a**2 / 2 * (J0**2 + J1**2)
    bent = own - a * J0 * J1 / k
    zero[alike] = ((own[:, :, None] + own[:, None]) / 2)[alike]
    one[alike] = ((bent[:, :, None] + bent[:, None]) / 2)[alike]
    whole = np.empty((k.shape[0], count + 1, count + 1), np.complex128)
    whole[:, 0, 0] = a**2 / 2
    whole[:, 1:, 0] = whole[:, 0, 1:] = a * J1 / k
    whole[:, 1:, 1:] = zero
    return whole, one
