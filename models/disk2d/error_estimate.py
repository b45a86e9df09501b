"""Error of a reduced disk, estimated from the residual of its solution in the full equations."""

import numpy as np

from ..base.arrays import Complexes, Frequencies, Reals
from .full import FullDisk, Shape
from .reduced import ReducedDisk

_SAFETY = 3.0


def estimate(full: FullDisk, reduced: ReducedDisk, shape: Shape, constants: Complexes, frequency: Frequencies) -> Reals:
    """Return the estimated relative error of the reduced capacitance, shape (N,); constants of shape (N, 10), SI.

    With r the residual of the reduced solution the error is 4 pi r A^-1 r exactly, A the full system: the form is
    stationary. A^-1 would be a full solution; here it is that of the static, lossless disk of the same constants,
    factored once. What a good basis leaves over lies in modes far above the band, for which the two agree; the
    factor 3 covers those nearer. `tests/benchmarks` compares with the true error.
    """
    n = full.size
    middle = constants[constants.shape[0] // 2].real
    solved = full.factor(full.system(shape.weights(middle), 0.0))
    made: list[float] = []
    for f, c in zip(frequency.tolist(), constants, strict=True):
        weights = shape.weights(c)
        x = reduced.solution(shape, weights, f)
        residual = full.system(weights, -((2 * np.pi * f) ** 2) * shape.mass) @ x
        r = full.scale * residual[:n]
        energy = abs(np.vdot(r, solved(r.real) + 1j * solved(r.imag)))
        capacitance = 4 * np.pi * abs(x @ residual)
        made.append(_SAFETY * 4 * np.pi * energy / capacitance)
    return np.array(made)
