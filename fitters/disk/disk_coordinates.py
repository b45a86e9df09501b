"""Joint coordinates of thickness- and radial-mode constants of one disk, passive everywhere.

In the plane the disk obeys T1 + T2 = C S - 2 H D, E = -H S + D/eps33p with S = S1 + S2, C = c11pD + c12pD and
H = h31p; its energy is a quadratic form of S and D, and passive if (Im H)^2 <= Im C Im(1/eps33p)/2. The clamped
permittivity is that of the thickness mode: 1/eps33p = 1/eps33S - h33^2/c33D, whose imaginary part is positive for
every passive plate. Shear in the plane involves only c11p - c12p = 1/(s11E - s12E).
"""

import numpy as np

from ...models.base.arrays import Complexes, Reals
from ..engine.parameters.coordinates import Block, thickness_constants

PLATE_CONSTANTS = ("c33D", "h33", "eps33S")
ARM_CONSTANTS = ("s11E", "s12E", "d31")
_LOSS_FLOOR = 1e-7
_ANGLE_LIMIT = 1.5
_H_UNIT = 1e7
# V/m. Above it the coordinate of h31p is logarithmic, like those of the constants that it is correlated with: sizes
# scale each constant by a power, so the valleys that they leave open are straight.
_PLATE = thickness_constants("")


def both_modes_constants(layer: str) -> Block:
    """Return c33D h33 eps33S s11E s12E d31 of a disk, passive for all coordinates; Pa V/m F/m 1/Pa C/N.

    x = those of `thickness_constants`, then ln C', ln(C''/C'), ln M', ln(M''/M'), asinh(H'/1e7), angle, with M = c11p -
    c12p and H'' = -sin(angle) sqrt(C'' (1/eps33p)''/2). The last six together determine the three radial constants.
    """
    names = (*PLATE_CONSTANTS, *ARM_CONSTANTS)
    return Block(
        tuple(f"{layer}.{name}{loss}" for name in names for loss in ("", ".loss")),
        tuple(f"{layer}.{name}.{part}" for name in names for part in ("re", "im")),
        _forward,
        _inverse,
        tuple(f"{layer}.{name}.loss" for name in ("c33D", "eps33S", "s11E", "s12E")),
    )


def _elastance(values: Reals, J: Reals) -> tuple[complex, Complexes]:
    """Return 1/eps33p from the plate's six real values, and its derivatives by the coordinates of `J`."""
    c, h, e = (complex(values[k], values[k + 1]) for k in (0, 2, 4))
    dc, dh, de = (J[k] + 1j * J[k + 1] for k in (0, 2, 4))
    return 1 / e - h**2 / c, np.asarray(-de / e**2 - 2 * h / c * dh + (h / c) ** 2 * dc, np.complex128)


def _forward(x: Reals) -> tuple[Reals, Reals]:
    plate, of_plate = _PLATE.forward(x[:6])
    wide = np.hstack([of_plate, np.zeros((6, 6))])
    beta, dbeta = _elastance(plate, wide)
    C_re, C_im, M_re, M_im = np.exp([x[6], x[6] + x[7], x[8], x[8] + x[9]]).tolist()
    C, M = complex(C_re, C_im), complex(M_re, M_im)
    bound = float(np.sqrt(C_im * beta.imag / 2))
    H = complex(_H_UNIT * np.sinh(x[10]), -np.sin(x[11]) * bound)
    unit = np.eye(12)
    dC, dM = C * unit[6] + 1j * C_im * unit[7], M * unit[8] + 1j * M_im * unit[9]
    dH = _H_UNIT * np.cosh(x[10]) * unit[10] - 1j * np.cos(x[11]) * bound * unit[11]
    dH = dH + 0.5j * H.imag * (unit[6] + unit[7] + dbeta.imag / beta.imag)
    N = beta * C - 2 * H**2
    dN = C * dbeta + beta * dC - 4 * H * dH
    plus, minus, d31 = beta / N, 1 / M, H / N
    dplus, dminus, dd31 = dbeta / N - plus / N * dN, -dM / M**2, dH / N - d31 / N * dN
    pairs = [((plus + minus) / 2, (dplus + dminus) / 2), ((plus - minus) / 2, (dplus - dminus) / 2), (d31, dd31)]
    values = np.concatenate([plate, *([value.real, value.imag] for value, _ in pairs)])
    return values, np.vstack([wide, *(part for _, slope in pairs for part in (slope.real, slope.imag))])


def _inverse(values: Reals) -> Reals:
    beta, _ = _elastance(values, np.zeros((6, 1)))
    s11, s12, d31 = (complex(values[k], values[k + 1]) for k in (6, 8, 10))
    plus, minus = s11 + s12, s11 - s12
    N = beta / plus  # beta C - 2 H^2
    H = d31 * N
    C, M = (N + 2 * H**2) / beta, 1 / minus
    losses = [max(part.imag / part.real, _LOSS_FLOOR) for part in (C, M)]
    bound = np.sqrt(C.real * losses[0] * beta.imag / 2)
    limit = np.sin(_ANGLE_LIMIT)
    angle = np.arcsin(np.clip(-H.imag / bound, -limit, limit))
    plane = [np.log(C.real), np.log(losses[0]), np.log(M.real), np.log(losses[1]), np.arcsinh(H.real / _H_UNIT), angle]
    return np.concatenate([_PLATE.inverse(values[:6]), plane])
