"""Coordinates of the ten constants of a ceramic that give those of its thickness mode, c33D and h33, too."""

from dataclasses import replace

import numpy as np

from ....models.base.arrays import Reals
from ....models.disk2d.matrices import CONSTANTS
from ...disk.two_d.tensor_coordinates import tensor_block
from ...engine.parameters.coordinates import Block

_C33, _E33, _EPS33 = (CONSTANTS.index(name) for name in ("c33E", "e33", "eps33S"))


def plate_block(layer: str) -> Block:
    """Return the ten constants of a layer, c33D and h33, from the twenty coordinates of `tensor_block`."""
    own = tensor_block(layer)
    names = tuple(f"{layer}.{name}.{part}" for name in ("c33D", "h33") for part in ("re", "im"))
    count = len(own.parameters)

    def forward(x: Reals) -> tuple[Reals, Reals]:
        values, J = own.forward(x)
        more, slopes = _plate(values, J)
        return np.concatenate([values, more]), np.vstack([J, slopes])

    def inverse(values: Reals) -> Reals:
        return own.inverse(values[:count])

    return replace(own, parameters=(*own.parameters, *names), forward=forward, inverse=inverse)


def _plate(values: Reals, J: Reals) -> tuple[Reals, Reals]:
    """Return c33D = c33E + e33 h33 and h33 = e33/eps33S as real and imaginary parts, and their derivatives."""
    z = values[0::2] + 1j * values[1::2]
    dz = J[0::2] + 1j * J[1::2]
    e, eps = z[_E33], z[_EPS33]
    h = e / eps
    dh = (dz[_E33] - h * dz[_EPS33]) / eps
    c, dc = z[_C33] + e * h, dz[_C33] + dz[_E33] * h + e * dh
    return np.array([c.real, c.imag, h.real, h.imag]), np.array([dc.real, dc.imag, dh.real, dh.imag])
