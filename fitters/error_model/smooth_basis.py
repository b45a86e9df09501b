"""Smooth random functions of ln f as a few columns of unit prior: Karhunen-Loeve expansion of a Matern 5/2 process."""

from collections.abc import Sequence
from functools import lru_cache

import numpy as np

from ...models.base.arrays import Reals

_NODES = 120
_NEGLIGIBLE = 1e-5
"""Part of the largest variance below which a function is dropped."""


def smooth(u: Reals, ends: tuple[float, float], length: float, most: int) -> Reals:
    """Return functions b(u), shape (N, K), such that sum a_k b_k with unit normal a is the process.

    `u` is ln f, shape (N,), within `ends`; the process has standard deviation 1 and this correlation length in ln f.
    """
    nodes, functions = _expanded(round(ends[0], 6), round(ends[1], 6), length, most)
    made = np.empty((u.size, functions.shape[1]))
    for k in range(functions.shape[1]):
        made[:, k] = np.interp(u, nodes, functions[:, k])
    return made


def ends_of(grids: Sequence[Reals]) -> tuple[float, float]:
    """Return the ends of what rising grids cover together, each of shape (N,)."""
    return float(min(own[0] for own in grids)), float(max(own[-1] for own in grids))


@lru_cache(maxsize=32)
def _expanded(low: float, high: float, length: float, most: int) -> tuple[Reals, Reals]:
    nodes = np.linspace(low, max(high, low + 1e-6), _NODES)
    distance = np.sqrt(5.0) * np.abs(nodes[:, None] - nodes) / length
    kernel = (1 + distance + distance**2 / 3) * np.exp(-distance)
    variance, functions = np.linalg.eigh(kernel)
    order = np.argsort(variance)[::-1][:most]
    kept = order[variance[order] > _NEGLIGIBLE * variance[order[0]]]
    return nodes, functions[:, kept] * np.sqrt(variance[kept])
