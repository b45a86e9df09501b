"""Where the fitter of the whole disk begins, and what it takes for granted of a piezoceramic."""

import math
from collections.abc import Mapping

import numpy as np

from ..models.build import Quantity
from ..models.disk2d.matrices import CONSTANTS
from ..models.errors import PzctlError
from ..models.materials import MATERIALS
from ..models.passivity import tensor_coordinates
from ..models.tensor import Tensor6mm
from .bare_disk import BareDisk
from .disk2d_coordinates import LOSSES, TURNS
from .objective import Posterior, Prior

_WIDTHS: Mapping[str, float] = {
    "c11E": 0.12,
    "c12E": 0.16,
    "c13E": 0.14,
    "c33E": 0.08,
    "c44E": 0.14,
    "e31": 0.40,
    "e33": 0.12,
    "e15": 0.25,
    "eps11S": 0.25,
    "eps33S": 0.20,
}
# Relative standard uncertainty of what is not known: how far the complete sets of the library lie from each other.
# Two published sets of one and the same Pz27 differ by 20 % in c11E, c12E, c13E and by 43 % in e31.
_LOSS, _LOSS_FACTOR = 0.01, 2.7
# Loss tangents of PZT: 1e-3 for hard, 3e-2 for the softest, as a logarithm with this standard deviation.
_ANGLE = 0.03
# How far the piezoelectric losses may lie from none, measured as the elements of A off its diagonal.


def _tensor(values: Mapping[str, Quantity]) -> Tensor6mm | None:
    """Return the tensor among the values of a layer or material; None where it is not complete."""
    if any(name not in values for name in CONSTANTS):
        return None
    return Tensor6mm(*(values[name].value for name in CONSTANTS))


def library() -> dict[str, Tensor6mm]:
    """Return the complete and passive tensors of the material library by material."""
    made: dict[str, Tensor6mm] = {}
    for material in MATERIALS:
        tensor = _tensor(material.values)
        if tensor is not None and _has_coordinates(tensor):
            made[material.name] = tensor
    return made


def _has_coordinates(tensor: Tensor6mm) -> bool:
    try:
        tensor_coordinates(tensor)
    except PzctlError:
        return False
    return True


def expected(disk: BareDisk) -> dict[str, float]:
    """Return the real parts of the ten constants that the layer's material has, else the library's mean; SI units."""
    own = _tensor(disk.layer.values)
    sets = [own] if own is not None else list(library().values())
    return {name: float(np.mean([complex(getattr(each, name)).real for each in sets])) for name in CONSTANTS}


def tensor_priors(disk: BareDisk) -> tuple[Prior | Posterior, ...]:
    """Return what is known of the ten constants before any recording, and of sizes and density."""
    at = disk.layer.name
    made: list[Prior] = []
    for name, value in expected(disk).items():
        made.append(Prior(f"{at}.{name}.re", value, _WIDTHS[name] * abs(value)))
    sizes = (Prior(disk.size_name(name), q.re, q.u) for name, q in disk.sizes.items() if q.u > 0)
    return (*made, *sizes, _loss_prior(at))


def _loss_prior(layer: str) -> Posterior:
    """Return what is known of losses, on the coordinates that make them: no recording tells all of them."""
    names = tuple(f"{layer}.{name}" for name in (*LOSSES, *TURNS))
    mean = np.array([math.log(_LOSS) / 2] * len(LOSSES) + [0.0] * len(TURNS))
    width = np.array([math.log(_LOSS_FACTOR) / 2] * len(LOSSES) + [_ANGLE] * len(TURNS))
    return Posterior(names, mean, np.diag(1 / width))


def starts(disk: BareDisk) -> list[dict[str, float]]:
    """Return model parameters to begin from: the layer's own tensor, then each of the library's."""
    own = _tensor(disk.layer.values)
    tensors = [own] if own is not None and _has_coordinates(own) else []
    tensors += [tensor for tensor in library().values() if tensor != own]
    sizes = {disk.size_name(name): q.re for name, q in disk.sizes.items()}
    return [sizes | _parameters(disk.layer.name, tensor) for tensor in tensors]


def _parameters(layer: str, tensor: Tensor6mm) -> dict[str, float]:
    values = {name: complex(getattr(tensor, name)) for name in CONSTANTS}
    return {
        f"{layer}.{name}.{part}": number
        for name, value in values.items()
        for part, number in (("re", value.real), ("im", value.imag))
    }
