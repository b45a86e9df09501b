"""`curing`: a passive layer, mostly glue, that is stiffer or less lossy from a later step on."""

from collections.abc import Mapping

import numpy as np

from ..stack import Elastic, Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at


class Curing(Effect):
    """Relative changes of a passive layer's stiffness and loss tangent from one step on, at the same density."""

    name = "curing"
    stage = Stage.CONSTANTS
    errs_roughly = False
    sizes = 2
    from_later_step = True
    only_named = True
    says = "{where} has other constants from this step on: it went on curing, or was heated."
    separates = "sweep the same step again after a day, and after an hour at 60 degrees"
    references = ("Challis et al., J. Phys. D 24 (1991) 1 (ultrasonic monitoring of curing epoxies)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return every passive layer."""
        return tuple(f"layer:{layer.name}" for layer in stack.layers if isinstance(layer, Elastic))

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the relative changes: curing epoxy becomes stiffer by tens of per cent, and loses half of its loss."""
        return (
            EffectParameter("stiffness", "1", typical=0.03, lower=-0.9, upper=3.0, prior=(0.0, 0.2)),
            EffectParameter("loss", "1", typical=0.1, lower=-0.95, upper=10.0, prior=(0.0, 0.4)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the changed layer."""
        name, root = layer_at(where), float(np.sqrt(1 + values["stiffness"]))
        factors = {f"{name}.z": root, f"{name}.c": root, f"{name}.q": 1 / (1 + values["loss"])}
        return assembly.scaled(factors)


EFFECT = Curing()
