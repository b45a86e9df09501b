"""`scatter`: grains or filler of a layer that scatter sound."""

from collections.abc import Mapping

from ..stack import Elastic, LossLaw, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.modified_laws import GrainScatter, with_stiffness_law
from .base.scale import resonance

_USUAL_END = 3.0


class Scatter(Effect):
    """A loss tangent ~ f^3 beside the layer's own, an attenuation ~ f^4: Rayleigh scattering by what is in the layer.

    It grows until grains are as large as the wavelength over 2 pi, and what it loses until there lowers the stiffness
    as the square of frequency (Kramers and Kronig): the layer's constants are those at the resonance of the ceramic. In
    one band it is mistaken for a lower Q of the layer, over two for a `loss-dispersion`, whose power of frequency is
    1.5 at most and whose stiffness rises.
    """

    name = "scatter"
    stage = Stage.CONSTANTS
    errs_roughly = False
    only_named = True
    says = "Grains, filler or pores of {where} scatter sound: it loses far more at high frequency."
    separates = "sweep the third overtone, or look at the size of the filler under a microscope"
    references = ("Stanke and Kino, J. Acoust. Soc. Am. 75 (1984) 665 (attenuation and velocity by grains)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every passive layer."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if isinstance(layer, Elastic))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return 1/Q by scatter at the resonance, and the frequency to which it grows, relative to the resonance.

        In a matching layer a quarter of a wavelength thick, grains with a radius of an eighth of it end it at 5.
        """
        return (
            EffectParameter("loss", "1", typical=1e-3, upper=0.2, prior=(3e-3, 1.5)),
            EffectParameter("end", "1", typical=1.0, lower=1.2, upper=20.0, null=_USUAL_END, scan=(2.0, 3.0, 6.0)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with that layer's stiffness and loss over frequency."""
        loss, end, reference = values["loss"], values.get("end", _USUAL_END), resonance(assembly.nominal)
        if loss <= 0:
            return assembly

        def grainy(law: LossLaw) -> GrainScatter:
            return GrainScatter(law, reference, loss, end)

        return assembly.each_stack(lambda stack: with_stiffness_law(stack, layer_at(where), grainy))


EFFECT = Scatter()
