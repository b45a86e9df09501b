"""Constrained constants: kept between bounds, or shared by several layers."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ....models.base.arrays import Reals
from .coordinates import Block

_EDGE = 0.999
# Largest |sin y| at the start: at the bound itself the derivative vanishes and the fit would not move.


def bounded(block: Block, limits: Mapping[str, tuple[float, float]]) -> Block:
    """Return the block with some of its coordinates, by name, kept between limits.

    x = middle + reach sin y, the transformation of MINUIT (F. James, M. Roos, Comput. Phys. Commun. 10 (1975) 343).
    """
    at = [block.coordinates.index(name) for name in limits]
    low, high = np.array(list(limits.values())).T
    middle, reach = (low + high) / 2, (high - low) / 2

    def forward(y: Reals) -> tuple[Reals, Reals]:
        x = y.copy()
        x[at] = middle + reach * np.sin(y[at])
        p, slopes = block.forward(x)
        factor = np.ones(x.size)
        factor[at] = reach * np.cos(y[at])
        return p, slopes * factor

    def inverse(p: Reals) -> Reals:
        x = np.asarray(block.inverse(p), dtype=np.float64).copy()
        x[at] = np.arcsin(np.clip((x[at] - middle) / reach, -_EDGE, _EDGE))
        return x

    return replace(block, forward=forward, inverse=inverse)


def shared(leader_block: Block, followers: tuple[str, ...]) -> Block:
    """Return the leader's constant shared by several layers: one coordinate for several equal parameters."""
    (leader,), count = leader_block.coordinates, 1 + len(followers)

    def forward(x: Reals) -> tuple[Reals, Reals]:
        p, J = leader_block.forward(x)
        return np.repeat(p, count), np.repeat(J, count, axis=0)

    return Block((leader,), (leader, *followers), forward, lambda p: leader_block.inverse(p[:1]))
