"""A soft ceramic with ten complex constants, each with its own loss: the truth of tests."""

from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.disk2d.matrices import CONSTANTS
from pzctl.models.materials import find
from pzctl.models.materials.material import Material, from_tensor

TENSOR = Tensor6mm(*(find("Pz27 Bergen").values[name].value for name in CONSTANTS))
MATERIAL = Material("test ceramic", "piezo", from_tensor(TENSOR, 7700, "Pz27 Bergen"))
