"""`temperature-gradient`: a ceramic whose constants change from one face to the other."""

from collections.abc import Mapping
from dataclasses import replace

from ..stack import GradedPiezo, Piezo, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, layer_at
from .base.modified_laws import with_piezo

_MOST = 0.8
"""Largest relative difference between the faces."""


class TemperatureGradient(Effect):
    """c33D and h33 change linearly from the back face to the front face; the constants are their means.

    One face is warmer, or less poled, than the other. Of a permittivity that changes, too, only a mean counts, since
    the same charge flows through all of the layer. Even overtones appear, which a uniform plate does not show: in
    proportion to the square of the difference on a plate with equal faces, which either sign changes alike. It is
    mistaken for a `surface-layer`, which shows them too, for a weak `spurious-resonance` at twice the frequency, and
    beside layers on one face for other constants of these.
    """

    name = "temperature-gradient"
    sizes = 2
    only_named = True
    says = "The constants of {where} change through its thickness: one face is warmer or less poled than the other."
    separates = "wait until both faces are as warm, turn the disk over, or sweep the second overtone"
    references = ("Auld, Acoustic Fields and Waves in Solids II (1973), chapter 12 (perturbation of resonators)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every piezoelectric layer; none where several are wired in parallel."""
        piezos = [layer for layer in stack.layers if isinstance(layer, Piezo)]
        if len(piezos) > 1 and stack.connection == "parallel":
            return ()
        return tuple(f"layer:{layer.name}" for layer in piezos)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the constants at the front face less those at the back face, relative to their means.

        Ten kelvin change the stiffness of a ceramic by half a per cent; poling that has not reached one face changes
        h33 by more. On a plate with equal faces, even overtones show |coupling - stiffness/4| alone; layers on one face
        tell them apart, and their signs.
        """
        return (
            EffectParameter("stiffness", "1", typical=0.01, lower=-_MOST, upper=_MOST),
            EffectParameter("coupling", "1", typical=0.03, lower=-_MOST, upper=_MOST),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the layer graded."""
        if not any(values.values()):
            return assembly
        gradients = values["stiffness"], values["coupling"]

        def graded(stack: Stack) -> Stack:
            made = with_piezo(stack, layer_at(where), lambda layer: GradedPiezo.of(layer, *gradients))
            return replace(made, connection="series")

        return assembly.each_stack(graded)


EFFECT = TemperatureGradient()
