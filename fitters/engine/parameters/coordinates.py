"""Coordinates of an optimiser, and their transformation to the constants of a model and back.

Every point of the coordinates must be physical. Positive constants are therefore fitted as logarithms, lossy constants
as modulus of the real part and loss, and the piezoelectric loss as the sine of an angle times the largest value that
passivity allows (Holland, IEEE Trans. Sonics Ultrason. 14 (1967) 18: the imaginary part of
[[c33D, -h33], [-h33, 1/eps33S]] is positive semidefinite).
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ....models.base.arrays import Reals

_LOSS_FLOOR = 1e-7
_ANGLE_LIMIT = 1.5
LEAST_Q = 0.5
# Quality factor of critical damping: below it nothing oscillates, and (1 + j/Q) describes no wave in a layer.
_HIGHEST_LOG_Q = 100.0
# ln of a quality factor beyond which nothing changes: an optimiser's long step must not overflow.
_H_UNIT = 1e8
# V/m. Above it the coordinate of h33 is logarithmic, like those of the constants that it is correlated with: the valley
# along c33D/(h33^2 eps33S), which thickness and density leave open to a per cent, is then straight. h33 has any sign.


@dataclass(frozen=True)
class Block:
    """A few coordinates that determine a few model parameters."""

    coordinates: tuple[str, ...]
    """Names of the coordinates: the constant's name, with `.loss` for its loss."""
    parameters: tuple[str, ...]
    """Names of the resulting model parameters."""
    forward: Callable[[Reals], tuple[Reals, Reals]]
    """Map coordinates, shape (C,), to parameters, shape (P,), and d parameter / d coordinate, shape (P, C)."""
    inverse: Callable[[Reals], Reals]
    """Map parameters, shape (P,), to coordinates, shape (C,)."""
    log_losses: tuple[str, ...] = ()
    """Names of the coordinates that are the logarithm of a loss tangent."""


def _exp(x: Reals) -> tuple[Reals, Reals]:
    p = np.exp(x)
    return p, p[:, None]


def _log(p: Reals) -> Reals:
    with np.errstate(divide="ignore"):  # a size that a fit has moved to zero has the coordinate -inf, and stays there
        return np.log(p)


def positive(name: str) -> Block:
    """Return the block of a positive constant: x = ln p."""
    return Block((name,), (name,), _exp, _log)


def quality(name: str) -> Block:
    """Return the block of a quality factor, which is above that of critical damping: x = ln(Q - 1/2)."""

    def forward(x: Reals) -> tuple[Reals, Reals]:
        above = np.exp(np.minimum(x, _HIGHEST_LOG_Q))
        return LEAST_Q + above, above[:, None]

    return Block((name,), (name,), forward, lambda p: np.log(np.maximum(p - LEAST_Q, _LOSS_FLOOR)))


def linear(name: str, unit: float) -> Block:
    """Return the block of a constant of either sign: p = unit x."""
    return Block((name,), (name,), lambda x: (unit * x, np.array([[unit]])), lambda p: p / unit)


def between(name: str, lower: float, upper: float) -> Block:
    """Return a constant between two limits: p = lower + (upper - lower)/(1 + exp(-x)); in ln p if lower > 0."""
    log = lower > 0
    low, high = (np.log(lower), np.log(upper)) if log else (lower, upper)

    def forward(x: Reals) -> tuple[Reals, Reals]:
        from scipy.special import expit  # imported late: who only lists or exports samples need not wait for it

        part = expit(x)
        inner, slope = low + (high - low) * part, (high - low) * part * (1 - part)
        p = np.exp(inner) if log else inner
        return p, (slope * p if log else slope)[:, None]

    def inverse(p: Reals) -> Reals:
        from scipy.special import logit

        inner = np.log(np.maximum(p, lower)) if log else p
        return logit(np.clip((inner - low) / (high - low), 1e-4, 1 - 1e-4))

    return Block((name,), (name,), forward, inverse)


def hardly_negative(name: str, unit: float) -> Block:
    """Return a constant that may be practically zero: p = unit (x + sqrt(x^2 + s^2))/2, s = 0.1.

    Linear where p is of the size of `unit`, never negative, and never so flat that an optimiser would get lost.
    """
    s = 0.1

    def forward(x: Reals) -> tuple[Reals, Reals]:
        root = np.sqrt(x**2 + s**2)
        return unit * (x + root) / 2, (unit * (1 + x / root) / 2)[:, None]

    def inverse(p: Reals) -> Reals:
        part = np.maximum(p / unit, 1e-3)
        return part - s**2 / (4 * part)

    return Block((name,), (name,), forward, inverse)


def thickness_constants(layer: str) -> Block:
    """Return c33D, h33 and eps33S of a piezo layer, passive for all values of the coordinates.

    x = ln c', ln(c''/c'), asinh(h'/1e8), angle, ln eps', ln tan d; h'' = -sin(angle) sqrt(c'' beta''), beta = 1/eps33S.
    """
    names = ("c33D", "h33", "eps33S")
    return Block(
        tuple(f"{layer}.{name}{loss}" for name in names for loss in ("", ".loss")),
        tuple(f"{layer}.{name}.{part}" for name in names for part in ("re", "im")),
        _thickness_forward,
        _thickness_inverse,
        (f"{layer}.c33D.loss", f"{layer}.eps33S.loss"),
    )


def _thickness_forward(x: Reals) -> tuple[Reals, Reals]:
    c_re, c_loss, h_re, angle, e_re, e_loss = (float(value) for value in x)
    c = np.exp(c_re)
    c_im = c * np.exp(c_loss)
    e, tan = np.exp(e_re), np.exp(e_loss)
    beta_im = tan / (e * (1 + tan**2))
    bound = np.sqrt(c_im * beta_im)
    h_im = -np.sin(angle) * bound
    values = np.array([c, c_im, _H_UNIT * np.sinh(h_re), h_im, e, -e * tan])
    J = np.zeros((6, 6))
    J[0, 0] = c
    J[1, 0] = J[1, 1] = c_im
    J[2, 2] = _H_UNIT * np.cosh(h_re)
    # d ln(bound): half of d ln c'' and of d ln beta''
    J[3] = h_im * np.array([0.5, 0.5, 0.0, 0.0, -0.5, 0.5 * (1 - tan**2) / (1 + tan**2)])
    J[3, 3] = -np.cos(angle) * bound
    J[4, 4] = e
    J[5, 4] = J[5, 5] = -e * tan
    return values, J


def to_h33(h: float) -> float:
    """Return the coordinate of the real part of h33, V/m."""
    return float(np.arcsinh(h / _H_UNIT))


def _thickness_inverse(values: Reals) -> Reals:
    c, c_im, h, h_im, e, e_im = (float(value) for value in values)
    c_loss, tan = max(c_im / c, _LOSS_FLOOR), max(-e_im / e, _LOSS_FLOOR)
    bound = np.sqrt(c * c_loss * tan / (e * (1 + tan**2)))
    angle = np.arcsin(np.clip(-h_im / bound, -np.sin(_ANGLE_LIMIT), np.sin(_ANGLE_LIMIT)))
    return np.array([np.log(c), np.log(c_loss), to_h33(h), angle, np.log(e), np.log(tan)])


def resonant_branch(name: str) -> Block:
    """Return R, L and C of a resonant branch; x = ln(2 pi fs), ln Q, ln C, which are nearly uncorrelated."""

    def forward(x: Reals) -> tuple[Reals, Reals]:
        w, Q, C = np.exp(x)
        values = np.array([1 / (w * C * Q), 1 / (w**2 * C), C])
        return values, values[:, None] * np.array([[-1.0, -1.0, -1.0], [-2.0, 0.0, -1.0], [0.0, 0.0, 1.0]])

    def inverse(values: Reals) -> Reals:
        R, L, C = values
        return np.log([1 / np.sqrt(L * C), np.sqrt(L / C) / R, C])

    coordinates = (f"{name}.fs", f"{name}.Q", f"{name}.C")
    return Block(coordinates, (f"{name}.R", f"{name}.L", f"{name}.C"), forward, inverse)


class Coordinates:
    """All coordinates of a fit: which of them are free, and the model parameters that they determine."""

    def __init__(self, blocks: tuple[Block, ...], start: Mapping[str, float], free: tuple[str, ...]) -> None:
        """`start`: values of the model parameters; `free`: names of the free coordinates."""
        self.blocks = blocks
        self.start = dict(start)
        self.names = tuple(name for block in blocks for name in block.coordinates)
        self.parameters = tuple(name for block in blocks for name in block.parameters)
        self.all = self._all_of(start)
        moving = [k for k, name in enumerate(self.names) if name in free]
        self.moving = np.array(moving, dtype=np.intp)
        self.free = tuple(self.names[k] for k in moving)
        logs = {name for block in blocks for name in block.log_losses}
        self.log_losses = [k for k, name in enumerate(self.free) if name in logs]
        """Indices of the free coordinates that are the logarithm of a loss tangent."""

    @property
    def x(self) -> Reals:
        """Start of the free coordinates, shape (M,)."""
        return self.all[self.moving]

    def without(self, *names: str) -> "Coordinates":
        """Return the same coordinates with these held at their start."""
        return Coordinates(self.blocks, self.start, tuple(name for name in self.free if name not in names))

    def held_at(self, values: Mapping[str, float]) -> "Coordinates":
        """Return the same coordinates with the held ones at the values of these model parameters."""
        full = self._all_of(values)
        full[self.moving] = self.x
        whole = Coordinates(self.blocks, self.start, self.names)
        return Coordinates(self.blocks, whole.forward(full)[0], self.free)

    def forward(self, x: Reals) -> tuple[dict[str, float], Reals]:
        """Return the model parameters and d parameter / d free coordinate, shape (P, M)."""
        full = self.all.copy()
        full[self.moving] = x
        values = self._at_start.copy()
        J = np.zeros((values.size, full.size))
        for block, rows, columns in self._moving_blocks:
            values[rows], J[rows, columns] = block.forward(full[columns])
        return dict(zip(self.parameters, values.tolist(), strict=True)), J[:, self.moving]

    @cached_property
    def _placed(self) -> list[tuple[Block, slice, slice]]:
        """The blocks, with the rows of their parameters and the columns of their coordinates."""
        placed: list[tuple[Block, slice, slice]] = []
        row = column = 0
        for block in self.blocks:
            rows, columns = slice(row, row + len(block.parameters)), slice(column, column + len(block.coordinates))
            placed.append((block, rows, columns))
            row, column = rows.stop, columns.stop
        return placed

    @cached_property
    def _at_start(self) -> Reals:
        """The model parameters at the start, shape (P,)."""
        return np.concatenate([block.forward(self.all[columns])[0] for block, _, columns in self._placed])

    @cached_property
    def _moving_blocks(self) -> list[tuple[Block, slice, slice]]:
        """Those of the blocks that have free coordinates: the others keep their start."""
        moving = set(self.moving.tolist())
        return [one for one in self._placed if not moving.isdisjoint(range(one[2].start, one[2].stop))]

    def inverse(self, values: Mapping[str, float]) -> Reals:
        """Return the free coordinates, shape (M,), of model parameters."""
        return self._all_of(values)[self.moving]

    def _all_of(self, values: Mapping[str, float]) -> Reals:
        parts = [block.inverse(np.array([values[name] for name in block.parameters])) for block in self.blocks]
        return np.concatenate(parts)
