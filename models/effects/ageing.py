"""`ageing`: constants of a layer that are others in later steps: depoling, curing, logarithmic time."""

from collections.abc import Mapping

from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import Effect, EffectParameter, Stage, layer_at
from .base.scale import active

_PARTS = {"stiffness": "c33D", "coupling": "h33", "permittivity": "eps33S"}


class Ageing(Effect):
    """Relative changes of stiffness, coupling and permittivity from one step on; losses change alike."""

    name = "ageing"
    stage = Stage.CONSTANTS
    errs_roughly = False
    sizes = 3
    from_later_step = True
    says = "The constants of {where} are others from this step on: it aged, was heated, or lost some of its poling."
    separates = "sweep the same step again after a day, and keep the temperature of gluing below half of Curie's"
    references = (
        "Berlincourt, Curran and Jaffe, in Mason (ed.), Physical Acoustics I A (1964), chapter 3 (ageing per decade)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return the active layer."""
        return (f"layer:{active(stack).name}",)

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the relative changes: a ceramic loses 1 to 5 % of its permittivity per decade of time.

        Even a hard one becomes stiffer by no more than 3 % per decade, and one that has lost all poling is softer by a
        fifth at most. What is further off is another ceramic, or no change of the ceramic at all.
        """
        return (
            EffectParameter("stiffness", "1", typical=1e-3, lower=-0.2, upper=0.05, prior=(0.0, 0.01)),
            EffectParameter("coupling", "1", typical=3e-3, lower=-0.9, upper=0.1, prior=(0.0, 0.02)),
            EffectParameter("permittivity", "1", typical=3e-3, lower=-0.5, upper=0.5, prior=(0.0, 0.03)),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the changed layer."""
        name = layer_at(where)
        factors = {
            f"{name}.{constant}.{part}": 1 + values[size] for size, constant in _PARTS.items() for part in ("re", "im")
        }
        return assembly.scaled(factors)


EFFECT = Ageing()
