"""Everything about a device, its wiring and its sweep that a build file omits; the defaults mean no flaw."""

from dataclasses import dataclass, replace
from typing import Literal

Side = Literal["back", "front"]


@dataclass(frozen=True)
class Wiring:
    """Wiring between device and analyzer; SI units, x = f/f0."""

    inductance: float = 0.0
    """H, of a lead."""
    skin: float = 0.0
    """ohm at 1 MHz of the lead's skin effect, growing as sqrt(f) in both parts."""
    winding: float = 0.0
    """F, across the lead itself."""
    resistance: float = 0.0
    """ohm in series at f0."""
    resistance_power: float = 0.0
    """Exponent of this resistance's growth with frequency."""
    capacitance: float = 0.0
    """F across the device at f0."""
    capacitance_tan: float = 0.0
    """Loss of that capacitance, constant over frequency; its value falls as causality requires."""
    conductance: float = 0.0
    """S across the device at f0."""
    conductance_power: float = 0.0
    delay: float = 0.0
    """s, one way through a cable."""
    cable_ohm: float = 50.0
    cable_loss: float = 0.0
    """Neper at f0 for the whole cable, growing as sqrt(f); half of it also affects the phase (inner inductance)."""
    contact: float = 0.0
    """ohm at f0 of a dry contact in series, a constant-phase element."""
    film: float = 0.0
    """S at f0 of a humid film across the device, growing as sqrt(f) in both parts."""
    loop: tuple[float, float, float] = (1.0, 1.0, 0.0)
    """A loop beside the lead: its Hz, Q and M^2/L in H."""


@dataclass(frozen=True)
class FixtureResidue:
    """Residuals after open and short compensation: H, ohm, ohm at 1 MHz (skin), F, S; reactances of either sign."""

    inductance: float = 0.0
    resistance: float = 0.0
    skin: float = 0.0
    capacitance: float = 0.0
    conductance: float = 0.0


@dataclass(frozen=True)
class Flaws:
    """All at once."""

    wiring: Wiring = Wiring()
    electrodes: tuple[float, float] = (0.0, 0.0)
    """kg/m2 of silver paste on the back and the front face of the ceramic."""
    dot: tuple[float, float, Side] | None = None
    """Fraction of the area under a solder dot, kg/m2, face of the step's stack."""
    void: tuple[str, float, float] | None = None
    """Layer in front of which the bond has a void, its fraction of the area, and its rim's area over its own."""
    spread: tuple[tuple[str, float, str], ...] = ()
    """Layer, relative standard deviation of its thickness, `gauss`, `triangle` or `skew`."""
    surface: tuple[float, Side, float, float] | None = None
    """Depth in m, face, and stiffness and permittivity there relative to those inside."""
    face: tuple[Side, str, float, float] | None = None
    """Face of the step's stack, `pad`, `fluid` or `viscous`; Rayl at f0; a shape number."""
    backing: tuple[float, float, float] | None = None
    """Length over the wavelength at f0, Q at f0, exponent of its loss, of a backing that ends in air."""
    relaxation: tuple[float, float, float, float] | None = None
    """Strength, f0 times its time constant over 2 pi, and both exponents of Havriliak and Negami."""
    viscosity: tuple[str, float, float] | None = None
    """Layer, fraction of its loss at f0 that is not of constant Q (may be negative), and that fraction's power."""
    modes: tuple[tuple[float, float, float, str], ...] = ()
    """Further resonances, of constant loss angle: Hz, Q, strength, `beside` the ceramic or `within` its stiffness."""
    untold: tuple[str, float] | None = None
    """A layer that is not in the build file, and its thickness in m; zero if the device does not have it either."""
    ageing: tuple[float, float, float] | None = None
    """Relative changes of c33D, h33 and eps33S from the first step to all later ones."""
    sheet: tuple[float, float] | None = None
    """ohm per square of an electrode, and the radius of the contact dot over the disk's."""
    drift: tuple[float, float, float] | None = None
    """Final relative changes of c33D and eps33S, and the time constant in sweeps, of an exponential drift."""
    softening: tuple[float, float, float] | None = None
    """Relative loss of stiffness at a strain of 1e-5, the loss factor of that change, and its power of the strain."""
    settling: float = 0.0
    """Time constant in s of each of the two poles of the detector."""
    lateral: tuple[float, ...] = ()
    """The disk has its finite diameter and two-dimensional modes: c11E c12E c13E c44E e31 e15 eps11S/eps0, SI."""
    recorded: str = "as it is"
    """Or `inverted`, `conjugated`."""
    piezo: tuple[float, float, float, float] | None = None
    """A relaxation of h33, as `relaxation`; of either sign."""
    anelastic: tuple[float, float] | None = None
    """Strength and frequency over f0 of a Debye relaxation by which c33D rises with frequency."""
    neighbour: tuple[float, float] | None = None
    """A second ceramic wired in parallel: its thickness and its area over those of the first."""
    recording: tuple[str, float, float] | None = None
    """A fault during the recording: `interference`, `loose contact` or `mixing`; size; place in the sweep (0 to 1)."""

    def wired(self, **changes: float) -> "Flaws":
        """Return the same with other wiring."""
        return replace(self, wiring=replace(self.wiring, **changes))

    def looped(self, loop: tuple[float, float, float]) -> "Flaws":
        """Return the same with a loop beside the lead: its Hz, Q and M^2/L in H."""
        return replace(self, wiring=replace(self.wiring, loop=loop))


NOTHING = Flaws()
