"""`electrode-mass`: electrodes (or wax, ink) that the build omits, as layers."""

from collections.abc import Mapping
from dataclasses import replace

from ..base.face_loads import FACES, Coat, HasFaces
from ..base.model import Model
from ..stack import Elastic, Stack
from .base.added_layer import is_face_of_one_ceramic, with_layer_on_piezo, with_layer_opposite
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, interfaces
from .base.scale import areal_mass

_RIGID, _PASTE, _SOFTEST = 1e9, 1.5e7, 2e6
"""Acoustic impedance of what is practically rigid, of fired silver paste, and of the softest, wax; Rayl."""
_Q, _SPEED = 50.0, 2000.0
"""Quality factor of a layer. Its velocity on a plate, m/s, does not matter: mass and impedance say what it does."""
_SLOWEST, _FIRED, _FASTEST = 1000.0, 3000.0, 5000.0
"""Velocity of longitudinal waves in a layer on a disk of finite diameter, which stretches it: wax, fired silver paste
with its pores, and beyond nickel's density for its stiffness; m/s."""
_OTHER = 0.7
"""Mass of the lighter electrode over the heavier one's with which fits begin: from 1 no derivative leads away."""
_DENSITY = 8500.0
"""Of fired silver, 10490 without its pores, kg/m3: the thickness of a layer on a disk is its mass over that."""


class ElectrodeMass(Effect):
    """A thin layer on a face or between two layers; within one band it resembles a softer or thicker disk, to 0.2 %.

    Electrodes are printed on both faces of a ceramic. The layer of a face is no rigid mass m where it is thick or soft:
    it acts as z tan(w m/z)/w. On a disk of finite diameter the stiffness of the electrodes counts as much as their
    mass, and bending appears where they are not alike.
    """

    name = "electrode-mass"
    stays = True
    errs_roughly = False
    lies_on_faces = Coat
    says = "There is a mass at {where} that the build omits: an electrode, wax or ink."
    separates = (
        "weigh the disk and measure its thickness, or sweep the third and fifth overtone; one band is not enough"
    )
    references = (
        "Sauerbrey, Z. Phys. 155 (1959) 206",
        "Miller and Bolef, J. Appl. Phys. 39 (1968) 5815 (a film beyond the limit of small mass)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both faces and every interface."""
        return (*FACES, *interfaces(stack))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the mass per area (kg/m2) and the acoustic impedance (Rayl) of the layer.

        At a ceramic also the mass on its other face, relative to this.
        """
        unit = areal_mass(stack)
        mass = EffectParameter("mass", "kg/m2", typical=5e-3 * unit, upper=unit, prior=(1.2e-2, 1.3))
        z = EffectParameter(
            "impedance", "Rayl", typical=_PASTE, lower=_SOFTEST, upper=_RIGID, null=_RIGID, scan=(_PASTE,)
        )
        other = EffectParameter("other", "1", typical=0.3, upper=1.0, fraction=True)
        return (mass, z, other) if is_face_of_one_ceramic(stack, where) else (mass, z)

    def parameters_in(self, model: Model, nominal: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the same; for a model with faces the mass of the heavier electrode and the speed of waves in it, m/s.

        And the mass of the other one, relative to this.
        """
        plate = self.effect_parameters(nominal, where)
        if not isinstance(model, HasFaces):
            return plate
        speed = EffectParameter("speed", "m/s", typical=500.0, lower=_SLOWEST, upper=_FASTEST, null=_FIRED)
        back = EffectParameter("other", "1", typical=0.3, upper=1.0, null=_OTHER, fraction=True)
        return (plate[0], speed, back)

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the layer in its place, and with that on the other face."""
        mass, z, other = values["mass"], values.get("impedance", _RIGID), values.get("other", 0.0)
        if mass <= 0:
            return assembly
        if not assembly.parts:
            speed, back = values.get("speed", _FIRED), values.get("other", _OTHER)
            return assembly.on_face(where, Coat(mass, speed, _Q, density=_DENSITY, back=back))
        paste = Elastic(f"{self.name}@{where}", thickness=mass * _SPEED / z, z=z, c=_SPEED, q=_Q)
        there = paste.thickness * other

        def printed(stack: Stack) -> Stack:
            made = with_layer_on_piezo(stack, where, paste)
            if there <= 0:
                return made
            return with_layer_opposite(made, where, replace(paste, name=f"{paste.name}-other", thickness=there))

        return assembly.each_stack(printed)


EFFECT = ElectrodeMass()
