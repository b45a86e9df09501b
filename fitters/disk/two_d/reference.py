"""Where constants of a fit in two dimensions are told: at the thickness resonance of the ceramic, as in data sheets.

By a causal law a constant with losses is another one elsewhere: a permittivity with tan d 0.02 by 0.4 % at 0.7 of that
frequency, many times its uncertainty.
"""

import math
from collections.abc import Iterable, Mapping

import numpy as np

from ....models.constants.causal import continued
from ....models.constants.tensor import Tensor6mm
from ....models.disk2d.matrices import CONSTANTS
from ....models.stack import CausalConstantQ, LossLaw
from ....models.sweep import Sweep


def tensor_of(values: Mapping[str, float], layer: str) -> Tensor6mm:
    """Return the tensor of model parameters."""
    return Tensor6mm(*(complex(values[f"{layer}.{c}.re"], values[f"{layer}.{c}.im"]) for c in CONSTANTS))


def parameters_of(tensor: Tensor6mm, layer: str) -> dict[str, float]:
    """Return the ten constants as model parameters."""
    values = {f"{layer}.{name}": complex(getattr(tensor, name)) for name in CONSTANTS}
    return {
        f"{name}.{part}": number
        for name, value in values.items()
        for part, number in (("re", value.real), ("im", value.imag))
    }


def reference_of(sweeps: Iterable[Sweep], values: Mapping[str, float], layer: str) -> float:
    """Return the reference frequency in Hz: the thickness resonance of a layer with these model parameters.

    The next recorded frequency, if it was not recorded.
    """
    stiffness = tensor_of(values, layer).thickness.c33D.real
    resonance = math.sqrt(stiffness / values[f"{layer}.density"]) / (2 * values[f"{layer}.thickness"])
    ends = np.array([(sweep.frequency[0], sweep.frequency[-1]) for sweep in sweeps])
    return float(np.clip(resonance, ends.min(), ends.max()))


def at_resonance(
    sweeps: Iterable[Sweep], values: Mapping[str, float], layer: str, law: LossLaw
) -> tuple[LossLaw, dict[str, float]]:
    """Return a layer's law and its ten constants, told at its thickness resonance if the law is causal."""
    tensor = tensor_of(values, layer)
    if not isinstance(law, CausalConstantQ):
        return law, parameters_of(tensor, layer)
    there = np.array([reference_of(sweeps, values, layer)])
    ten = (continued(law, complex(getattr(tensor, name)), there)[0] for name in CONSTANTS)
    return CausalConstantQ(float(there[0])), parameters_of(Tensor6mm(*(complex(value[0]) for value in ten)), layer)


def in_words(law: LossLaw) -> str:
    """Return what follows "Constants" in a sentence on constants of this law."""
    if isinstance(law, CausalConstantQ):
        return f"at {law.reference / 1e3:.5g} kHz, with causal losses"
    return "with losses that are the same at all frequencies"
