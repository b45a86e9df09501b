"""`prestress-bolt`: a bolt that presses the piezoelectric layers together and that the build omits."""

from collections.abc import Mapping
from dataclasses import replace

from ..stack import Bolt, Elastic, Piezo, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, interface_at
from .base.scale import active

_THICK = 0.5
"""Least thickness of a layer that can hold a bolt, relative to the thickest piezoelectric layer."""


class PrestressBolt(Effect):
    """A spring without mass, parallel to all that lies between the two layers that hold it."""

    name = "prestress-bolt"
    says = "A bolt, or another elastic path beside the layers, joins {where}; the build omits it."
    separates = "measure with the bolt at another tension or of another material, or weigh and measure the bolt"
    references = ("Stansfield, Underwater Electroacoustic Transducers (1991): the stress bolt",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return `interface:A|B` of the layers that can hold its ends, in a sandwich of piezoelectric layers."""
        piezos = [k for k, layer in enumerate(stack.layers) if isinstance(layer, Piezo)]
        if stack.bolt is not None or len(piezos) < 2:
            return ()
        least = _THICK * active(stack).thickness
        holds = [isinstance(layer, Elastic) and layer.thickness >= least for layer in stack.layers]
        behind = [k for k in range(piezos[0]) if holds[k]]
        before = [k for k in range(piezos[-1] + 1, len(holds)) if holds[k]]
        if not behind or not before:
            return ()
        return (f"interface:{stack.layers[behind[-1]].name}|{stack.layers[before[0]].name}",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the stiffness in N/m: some hundredths of that of the piezoelectric layers."""
        piezos = [layer for layer in stack.layers if isinstance(layer, Piezo)]
        whole = stack.area / sum(layer.thickness / layer.c33D.real for layer in piezos)
        return (EffectParameter("stiffness", "N/m", typical=1e-3 * whole, upper=10 * whole, prior=(0.05 * whole, 1.3)),)

    def sentence(self, where: str, sizes: Mapping[str, tuple[float, float, str]]) -> str:
        """Return the sentence with the names of the two layers."""
        return self.says.format(where=" and ".join(interface_at(where)))

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the bolt."""
        stiffness, (behind, before) = values["stiffness"], interface_at(where)
        if stiffness <= 0:
            return assembly
        return assembly.each_stack(lambda stack: replace(stack, bolt=Bolt(behind, before, stiffness)))


EFFECT = PrestressBolt()
