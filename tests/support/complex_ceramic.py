"""A soft ceramic with ten complex constants, each with losses of its own: the truth of tests, and no material by name.

The library has such a set of no material, as no source prints one for a ceramic that is usual in transducers.
"""

from pzctl.models.constants.piezo_constants import EPS0
from pzctl.models.constants.tensor import Tensor6mm
from pzctl.models.materials.material import Material, from_tensor

TENSOR = Tensor6mm(
    118.75e9 * (1 + 1j / 95.75),
    74.30e9 * (1 + 1j / 71.24),
    74.25e9 * (1 + 1j / 120.19),
    112.05e9 * (1 + 1j / 177.99),
    21.10e9 * (1 + 1j / 75),
    -5.40 * (1 - 1j / 166),
    16.0389 * (1 - 1j / 323.77),
    11.20 * (1 - 1j / 200),
    916 * EPS0 * (1 - 1j / 50),
    920 * EPS0 * (1 - 1j / 86.28),
)
MATERIAL = Material("test ceramic", "piezo", from_tensor(TENSOR, 7700, "chosen for tests"))
