"""`loss-dispersion`: the quality factor of a layer depends on frequency."""

from collections.abc import Mapping
from typing import TypeGuard

from ..stack import CausalConstantQ, ConstantLoss, Elastic, LossLaw, Piezo, Stack
from ..stack.stack import Layer
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.modified_laws import LossExponent, with_stiffness_law
from .base.scale import resonance


class LossDispersion(Effect):
    """1/Q ~ f^n, with the constants at the resonance: one band hardly shows it, an overtone does."""

    name = "loss-dispersion"
    stage = Stage.CONSTANTS
    errs_roughly = False
    of_laws = True
    says = "The loss of {where} is not the same at all frequencies: its Q changes from one overtone to the next."
    separates = "sweep the third overtone, or the radial and the thickness mode of the same disk"
    references = (
        "Kjartansson, J. Geophys. Res. 84 (1979) 4737",
        "Szabo, J. Acoust. Soc. Am. 96 (1994) 491 (causal power laws)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every layer whose loss law has no exponent of its own."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if _law_of(layer))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the exponent, and the weight of its causal companion (if the law is not causal yet)."""
        layer = next(layer for layer in stack.layers if layer.name == layer_at(where))
        exponent = EffectParameter("exponent", "1", typical=0.3, lower=-1.5, upper=1.5, prior=(0.0, 0.6))
        if isinstance(_law_of(layer), CausalConstantQ):
            return (exponent,)
        return (exponent, EffectParameter("companion", "1", typical=1.0, upper=1.0, fraction=True))

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the loss of that layer as a power of frequency."""
        name, reference = layer_at(where), resonance(assembly.nominal)

        def bend(law: LossLaw) -> LossExponent:
            return LossExponent(law, reference, values["exponent"], values.get("companion", 1.0))

        def lossy(law: LossLaw) -> LossLaw:
            return bend(law) if _without_exponent(law) else law

        bent = assembly.each_law(name, "elastic", bend)
        return bent.each_stack(lambda stack: with_stiffness_law(stack, name, lossy))


def _law_of(layer: Layer) -> ConstantLoss | CausalConstantQ | None:
    """Return the law of the layer's stiffness; None if it has an exponent or there is no stiffness."""
    law = layer.c_law if isinstance(layer, Piezo) else layer.law if isinstance(layer, Elastic) else None
    return law if _without_exponent(law) else None


def _without_exponent(law: LossLaw | None) -> TypeGuard[ConstantLoss | CausalConstantQ]:
    return isinstance(law, ConstantLoss | CausalConstantQ)


EFFECT = LossDispersion()
