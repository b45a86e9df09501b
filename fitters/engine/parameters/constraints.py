"""Constrained constants: kept between bounds, or shared by several layers."""

from collections.abc import Mapping, Sequence
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


def shared(leader_block: Block, followers: Sequence[tuple[str, ...]]) -> Block:
    """Return the leader's constants shared by several layers: the same coordinates for several equal parameters.

    Each of `followers` names the parameters of one layer, in the order of the leader's.
    """
    own, count = len(leader_block.parameters), 1 + len(followers)

    def forward(x: Reals) -> tuple[Reals, Reals]:
        p, J = leader_block.forward(x)
        return np.tile(p, count), np.tile(J, (count, 1))

    def inverse(p: Reals) -> Reals:
        return leader_block.inverse(p[:own])

    names = (*leader_block.parameters, *(name for follower in followers for name in follower))
    return replace(leader_block, parameters=names, forward=forward, inverse=inverse)
