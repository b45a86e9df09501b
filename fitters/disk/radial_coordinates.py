"""Coordinates of the radial-mode constants, stable and passive everywhere.

Compliance loss L = -Im s and Holland's condition (IEEE Trans. Sonics Ultrason. 14 (1967) 18) for a poled disk:
|L12| <= L11 and 2 (Im d31)^2 <= (L11 + L12) (-Im eps33T). The real parts are stable for |sigma_p| < 1 and kp < 1.
Poisson's ratio and the planar coupling of the real parts are therefore hyperbolic tangents of coordinates, and the two
losses that are bounded by others are sines of an angle.
"""

import numpy as np

from ...models.base.arrays import Reals
from ..engine.parameters.coordinates import Block, linear

RADIAL_CONSTANTS = ("s11E", "s12E", "d31", "eps33T")
_LOSS_FLOOR = 1e-7
_ANGLE_LIMIT = 1.5
_RATIO_LIMIT = 0.999


def radial_constants_block(layer: str) -> Block:
    """Return s11E, s12E, d31 and eps33T of a piezo layer, stable and passive for all coordinates.

    x = ln s11', ln(L11/s11'), artanh sigma', angle of L12/L11, artanh kp', angle of d31'', ln eps', ln tan d. Holding
    s12E therefore holds Poisson's ratio s12E'/s11E', and holding d31 the planar coupling. 1/Pa, C/N, F/m.
    """
    return Block(
        tuple(f"{layer}.{name}{loss}" for name in RADIAL_CONSTANTS for loss in ("", ".loss")),
        tuple(f"{layer}.{name}.{part}" for name in RADIAL_CONSTANTS for part in ("re", "im")),
        _forward,
        _inverse,
        (f"{layer}.s11E.loss", f"{layer}.eps33T.loss"),
    )


def plate_blocks(layer: str) -> tuple[Block, Block]:
    """Return the blocks of the motion through the thickness: `alpha`, and `d33f` (C/N)."""
    return linear(f"{layer}.alpha", 1.0), linear(f"{layer}.d33f", 1e-10)


def _forward(x: Reals) -> tuple[Reals, Reals]:
    s, loss, e, tan = np.exp(x[[0, 1, 6, 7]]).tolist()
    sigma, k = np.tanh(x[[2, 4]]).tolist()
    sine, cosine = float(np.sin(x[3])), float(np.cos(x[3]))
    L11, e_im = s * loss, e * tan
    unit = np.sqrt(e * s * (1 - sigma) / 2)
    d = -k * unit
    bound = np.sqrt(L11 * (1 + sine) * e_im / 2)
    d_im = np.sin(x[5]) * bound
    values = np.array([s, -L11, -sigma * s, -L11 * sine, d, d_im, e, -e_im])
    J = np.zeros((8, 8))
    J[0, 0] = s
    J[1, :2] = -L11
    J[2, 0], J[2, 2] = -sigma * s, -s * (1 - sigma**2)
    J[3, :2], J[3, 3] = -L11 * sine, -L11 * cosine
    J[4, [0, 6]] = d / 2
    J[4, 2] = -d / 2 * (1 + sigma)  # d ln(1 - sigma)/da = -(1 - sigma^2)/(1 - sigma)
    J[4, 4] = -unit * (1 - k**2)
    J[5, [0, 1, 6, 7]] = d_im / 2
    # d sqrt(1 + sine) = cosine/(2 sqrt(1 + sine)), written without a division by zero where 1 + sine vanishes
    J[5, 3] = np.sin(x[5]) * np.sqrt(L11 * e_im / 2) * np.sign(cosine) * np.sqrt(max(0.0, 1 - sine)) / 2
    J[5, 5] = np.cos(x[5]) * bound
    J[6, 6] = e
    J[7, 6:] = -e_im
    return values, J


def _inverse(values: Reals) -> Reals:
    s, s_im, s12, s12_im, d, d_im, e, e_im = (float(value) for value in values)
    loss, tan = max(-s_im / s, _LOSS_FLOOR), max(-e_im / e, _LOSS_FLOOR)
    sigma = float(np.clip(-s12 / s, -_RATIO_LIMIT, _RATIO_LIMIT))
    k = float(np.clip(-d / np.sqrt(e * s * (1 - sigma) / 2), -_RATIO_LIMIT, _RATIO_LIMIT))
    L11, limit = s * loss, float(np.sin(_ANGLE_LIMIT))
    sine = float(np.clip(-s12_im / L11, -limit, limit))
    bound = np.sqrt(L11 * (1 + sine) * e * tan / 2)
    turn = np.arcsin(np.clip(d_im / bound, -limit, limit))
    return np.array(
        [np.log(s), np.log(loss), np.arctanh(sigma), np.arcsin(sine), np.arctanh(k), turn, np.log(e), np.log(tan)]
    )
