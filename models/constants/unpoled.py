"""The ceramic that a poled one is made of: its grains in all directions, so that nothing is piezoelectric."""

import numpy as np

from ..base.arrays import Complexes


def unpoled_ratio(constants: Complexes) -> Complexes:
    """Return c12/c11 of the mean over all directions of ten constants in SI units, shape (..., 10): shape (...).

    In the order c11E c12E c13E c33E c44E e31 e33 e15 eps11S eps33S. The stiffness is Voigt's mean (W. Voigt, Lehrbuch
    der Kristallphysik (1910) 962) between that at constant E and at constant D: around a grain neither is held.
    """
    c11, c12, c13, c33, c44, e31, e33, e15, eps11, eps33 = np.moveaxis(constants, -1, 0)
    c11, c12 = c11 + e31**2 / (2 * eps33), c12 + e31**2 / (2 * eps33)
    c13, c33, c44 = c13 + e31 * e33 / (2 * eps33), c33 + e33**2 / (2 * eps33), c44 + e15**2 / (2 * eps11)
    compression = (2 * c11 + c33 + 2 * c12 + 4 * c13) / 9
    shear = (7 * c11 - 5 * c12 + 2 * c33 - 4 * c13 + 12 * c44) / 30
    return (compression - 2 * shear / 3) / (compression + 4 * shear / 3)
