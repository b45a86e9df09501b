"""Continuation of lossy constants over frequency, whatever their sign.

The laws themselves (constant loss, Kjartansson's causal constant Q, power laws) are those of the stack's layers. A
causal law raises (jw) to the phase of the constant, so a negative constant (s12E, d31, a negative h33) goes as minus
the law of its negative: its phase is its loss angle, not pi.
"""

from collections.abc import Mapping

import numpy as np

from ..base.arrays import Complexes, Frequencies
from ..stack.loss_laws import ComplexLike, LossLaw


def continued(law: LossLaw, value: complex, frequency: Frequencies) -> tuple[Complexes, Mapping[str, Complexes]]:
    """Return the constant at frequencies in Hz, shape (N,), and its derivatives by `re`, `im` and the law's own.

    A permittivity under `CausalConstantQ` is the constant-phase element; a stiffness, Kjartansson's solid.
    """
    sign = -1 if value.real < 0 else 1

    def wide(array: ComplexLike, times: int) -> Complexes:
        return np.multiply(times, np.broadcast_to(array, frequency.shape), dtype=np.complex128)

    slopes = {
        key: wide(size, 1 if key in ("re", "im") else sign)
        for key, size in law.derivatives(sign * value, frequency).items()
    }
    return wide(law.over(sign * value, frequency), sign), slopes
