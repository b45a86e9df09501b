"""A transducer as a plate of layers: exact impedance, exact derivatives.

>>> import numpy as np
>>> disk = Piezo("disk", thickness=0.512e-3, density=7700.0, c33D=1.444e11 * (1 + 1j / 80), h33=1.98e9,
...              eps33S=8.09e-9 * (1 - 0.017j))
>>> ml1 = Elastic("ml1", thickness=139e-6, z=10.3e6, c=2455.0, q=60.0)
>>> stack = (AIR | disk | ml1 | AIR).with_area(2.01e-4)
>>> Z, J = stack.jacobian(np.linspace(1e6, 6e6, 801), ["disk.thickness", "ml1.z"])
>>> Z.shape, J.shape
((801,), (2, 801))

`laws` describes how losses continue over frequency, `layers` and `lumps` are the elements of a stack, `loads` and
`radiation` its terminations; `acoustic_line` is the wave in one layer, `active` adds the piezoelectric effect,
`network` connects the layers, `slopes` differentiates; `strips` evaluates parallel stacks, `graded` is a layer whose
constants change through its thickness.
"""

from .bolt import Bolt
from .graded import GradedPiezo
from .layers import Elastic, Piezo
from .loads import AIR, VACUUM, AnyLoad, HalfSpace, Load, Support
from .loss_laws import CONSTANT, CausalConstantQ, ConstantLoss, LossLaw, PowerLoss, StackError, viscous
from .lumps import Mass, Spring
from .radiation import Piston
from .stack import Layer, Stack
from .strips import Strips

__all__ = [
    "AIR",
    "CONSTANT",
    "VACUUM",
    "AnyLoad",
    "Bolt",
    "CausalConstantQ",
    "ConstantLoss",
    "Elastic",
    "GradedPiezo",
    "HalfSpace",
    "Layer",
    "Load",
    "LossLaw",
    "Mass",
    "Piezo",
    "Piston",
    "PowerLoss",
    "Spring",
    "Stack",
    "StackError",
    "Strips",
    "Support",
    "viscous",
]
