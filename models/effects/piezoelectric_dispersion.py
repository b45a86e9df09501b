"""`piezoelectric-dispersion`: the piezoelectric constant depends on frequency."""

from collections.abc import Mapping
from dataclasses import replace

from ..stack import Piezo, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.modified_laws import Relaxation, Slope, with_piezo
from .base.scale import resonance


class PiezoelectricDispersion(Effect):
    """h33 ~ f^(-slope), with its constant value at the resonance, and a relaxation of either sign.

    Domain walls that no longer follow take part in e33 and in eps33S: h33, their quotient, rises or falls. The loss
    that belongs to a slope is the same at all frequencies and part of h33''.
    """

    name = "piezoelectric-dispersion"
    stage = Stage.CONSTANTS
    errs_roughly = False
    sizes = 2
    says = "The piezoelectric constant of {where} changes with frequency, as where domain walls no longer follow."
    separates = "measure the overtones: their coupling differs from that of the first resonance"
    references = (
        "Damjanovic, Rep. Prog. Phys. 61 (1998) 1267, section 6: logarithmic dispersion of piezoelectric coefficients",
        "Holland, IEEE Trans. Sonics Ultrason. 14 (1967) 18: complex elastic, dielectric and piezoelectric constants",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every piezoelectric layer."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if isinstance(layer, Piezo))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return -d ln h'/d ln f, strength of the relaxation, f/resonance of the relaxation."""
        return (
            EffectParameter("slope", "1", typical=0.005, lower=-0.2, upper=0.2, prior=(0.0, 0.005)),
            EffectParameter("relaxation", "1", typical=0.01, lower=-0.3, upper=0.3, prior=(0.0, 0.03)),
            EffectParameter("relaxation_frequency", "1", typical=0.1, lower=0.02, upper=10.0, null=0.8),
        )

    def added_losses(self, where: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the loss of the relaxation at the resonance."""
        at = values["relaxation_frequency"]
        return {f"{layer_at(where)}.h33": values["relaxation"] * (1 / (1 + 1j / at)).imag}

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the piezoelectric constant of that layer as a function of frequency."""
        name, reference = layer_at(where), resonance(assembly.nominal)

        def bent(layer: Piezo) -> Piezo:
            falls = Slope(layer.h_law, reference, values["slope"])
            relaxes = Relaxation(falls, reference, values["relaxation"], values["relaxation_frequency"])
            return replace(layer, h_law=relaxes)

        return assembly.each_stack(lambda stack: with_piezo(stack, name, bent))


EFFECT = PiezoelectricDispersion()
