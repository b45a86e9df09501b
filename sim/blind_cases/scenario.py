"""The hidden sizes of a device: everything that its build file omits."""

from dataclasses import dataclass, field
from typing import Literal

from .node_circuit import Path

Side = Literal["back", "front"]


@dataclass(frozen=True)
class Hidden:
    """All hidden sizes, SI units; the defaults hide nothing."""

    path: Path = field(default_factory=Path)
    mass: tuple[float, float] = (0.0, 0.0)
    """kg/m2 on the back and the front electrode of the disk."""
    dot: tuple[float, float, Side] | None = None
    """A solder dot: part of the area, kg/m2, face of the step's stack."""
    void: tuple[str, float] | None = None
    """The layer (`disk`, `ml1`) in front of which the bond is missing, and the fraction of the area."""
    taper: tuple[str, float, str] | None = None
    """Layer, relative half range of its thickness, `wedge`, `round wedge`, `dome` or `rough`."""
    surface: tuple[float, Side, str] | None = None
    """Depth in m, face of the disk, `dead` or `graded`."""
    face: tuple[Side, str, float] | None = None
    """Face of the step's stack, `resistive` or `spring` or `fluid`, and Rayl or Pa/m or Rayl."""
    backing: tuple[float, float] | None = None
    """Length over the wavelength at the disk's resonance, and Q, of a backing that ends in air."""
    loss_power: tuple[str, float, bool] | None = None
    """Layer, exponent of 1/Q over frequency, and whether the stiffness follows from causality."""
    dielectric: tuple[str, float] | None = None
    """`power` and the exponent of eps, or `relaxation` and its strength."""
    omitted: tuple[str, float] | None = None
    """A layer that the build file omits, and its thickness in m; zero if the device does not have it either."""
    drift: tuple[float, float] | None = None
    """Relative drift of c33D and of eps33S over one sweep."""
    softening: float = 0.0
    """Relative loss of stiffness per strain."""
    settling: float = 0.0
    """s, time constant of the detector."""
    modes: bool = False
    """Whether the disk has its finite diameter and vibrates in both dimensions."""
    recorded: Literal["as it is", "conjugated", "inverted"] = "as it is"
    outside: tuple[str, float, float] | None = None
    """An instrument artefact outside the catalogue: its kind, its size, and its place in the sweep (0 to 1)."""


NOTHING = Hidden()
