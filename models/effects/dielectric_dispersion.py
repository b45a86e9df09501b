"""`dielectric-dispersion`: permittivity and loss tangent depend on frequency."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..stack import LossLaw, Piezo, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.modified_laws import Relaxation, Slope, with_piezo
from .base.scale import resonance

_SOFT = 7e-3
"""Slope in a soft ceramic, for a layer whose loss the build does not state."""

_RELAXES = (0.1, 0.3, 1.0, 3.0)
"""Frequencies of a relaxation, relative to the resonance, from which fits start: below, within and above most bands."""


def _causal_slope(layer: object) -> float:
    """Return the slope -d ln eps'/d ln f that causality demands of a loss tangent that is the same at all frequencies.

    eps ~ (jw)^-s has eps''/eps' = tan(s pi/2) (Jonscher).
    """
    if not isinstance(layer, Piezo) or layer.eps33S.imag == 0:
        return _SOFT
    return float(2 / np.pi * np.arctan(abs(layer.eps33S.imag) / layer.eps33S.real))


class DielectricDispersion(Effect):
    """eps33S ~ f^(-slope), with its constant value at the resonance, and a relaxation that is not a power law.

    Causality relates the slope to the loss, slope = (2/pi) atan(tan d); it is left free, so that the relation can be
    checked.
    """

    name = "dielectric-dispersion"
    stage = Stage.CONSTANTS
    errs_roughly = False
    of_laws = True
    sizes = 2
    says = "The permittivity of {where} falls with frequency, as that of any lossy dielectric does."
    separates = "sweep up and down (a drift reverses, this does not), and measure C and tan d well below resonance"
    references = (
        "Debye, Polar Molecules (1929): relaxation",
        "Jonscher, Dielectric Relaxation in Solids (1983): the universal response (jw)^(n-1)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every piezoelectric layer."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if isinstance(layer, Piezo))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return -d ln eps'/d ln f, strength of the relaxation, d ln tan d/d ln f, f/resonance of the relaxation.

        A slope is usually that which causality demands of the build's loss: 0.008 for Pz27, 0.09 for P(VDF-TrFE).
        """
        slope = _causal_slope(next(layer for layer in stack.layers if layer.name == layer_at(where)))
        return (
            EffectParameter("slope", "1", typical=0.01, upper=0.5, prior=(slope, 1.4)),
            EffectParameter("relaxation", "1", typical=0.01, upper=0.5, prior=(1e-2, 1.8)),
            EffectParameter("loss_exponent", "1", typical=0.3, lower=-1.0, upper=1.0, prior=(0.0, 0.4)),
            EffectParameter("relaxation_frequency", "1", typical=0.1, lower=0.02, upper=10.0, null=0.3, scan=_RELAXES),
        )

    def added_losses(self, where: str, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the loss of the relaxation at the resonance."""
        at = values["relaxation_frequency"]
        return {f"{layer_at(where)}.eps33S": values["relaxation"] * (1 / (1 + 1j / at)).imag}

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the permittivity of that layer as a power of frequency."""
        name, reference = layer_at(where), resonance(assembly.nominal)

        def bend(law: LossLaw) -> LossLaw:
            falls = Slope(law, reference, values["slope"], values["loss_exponent"])
            if values["relaxation"] <= 0:
                return falls
            return Relaxation(falls, reference, values["relaxation"], values["relaxation_frequency"])

        bent = assembly.each_law(name, "dielectric", bend)
        return bent.each_stack(
            lambda stack: with_piezo(stack, name, lambda layer: replace(layer, eps_law=bend(layer.eps_law)))
        )


EFFECT = DielectricDispersion()
