"""Lossy constants continued over frequency, whatever their sign.

The laws themselves (constant loss, Kjartansson's causal constant Q, power laws) are those of the stack's layers. A
causal law raises (jw) to the phase of the constant, so a negative constant (s12E, d31, a negative h33) goes as minus
the law of its negative: its phase is its loss angle, not pi.
"""

from collections.abc import Mapping

import numpy as np

from .arrays import Complexes, Frequencies
from .stack.laws import LossLaw


def continued(law: LossLaw, value: complex, frequency: Frequencies) -> tuple[Complexes, Mapping[str, Complexes]]:
    """Return the constant at frequencies in Hz, shape (N,), and its derivatives by `re`, `im` and the law's own.

    A permittivity under `CausalConstantQ` is the constant-phase element; a stiffness, Kjartansson's solid.
    """
    if value == 0:
        unit = np.broadcast_to(law.over(1 + 0j, frequency), frequency.shape).astype(np.complex128)
        own = {key: np.zeros_like(unit) for key in law.parameters()}
        return np.zeros_like(unit), {"re": unit, "im": 1j * unit, **own}
    sign = -1 if value.real < 0 else 1
    positive = np.broadcast_to(law.over(sign * value, frequency), frequency.shape)
    constant = sign * positive
    slopes = {
        key: np.multiply(constant * (sign if key in ("re", "im") else 1), size)
        for key, size in law.log_derivatives(sign * value, frequency).items()
    }
    return constant.astype(np.complex128), slopes
