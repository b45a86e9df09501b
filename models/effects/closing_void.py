"""`closing-void`: a crack or a bond that has come off, whose faces touch more or less with the oscillator level."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..stack import Stack
from .base.assembly import Assembly
from .base.effect import EffectParameter
from .bond_void import BondVoid


class ClosingVoid(BondVoid):
    """A void whose part of the area is phi e^(-closing V), V the oscillator level: its faces touch, or come apart.

    A void that does not depend on the level is a `bond-void`.
    """

    name = "closing-void"
    lies_on_faces = None
    only_named = True
    says = "The parts at {where} touch on more or less of the area with the oscillator level: a crack, or a loose bond."
    separates = "sweep at three levels, 5 mV to 1 V, and press the parts together while sweeping"
    references = (
        "Solodov, Krohn and Busse, Ultrasonics 40 (2002) 621 (contact acoustic nonlinearity)",
        "Baik and Thompson, J. Nondestruct. Eval. 4 (1984) 177 (imperfect interfaces)",
    )

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the part of the area without drive, and how fast it closes (1/V; below zero, it opens)."""
        return (
            EffectParameter("fraction", "1", typical=0.01, upper=0.95, prior=(0.05, 1.3)),
            EffectParameter("closing", "1/V", typical=0.3, lower=-3.0, upper=10.0),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with what is open at the level of its sweep."""
        still = float(np.exp(-values["closing"] * assembly.conditions.level_V))
        made = super().extend(assembly, where, {"fraction": min(0.95, values["fraction"] * still)})
        own = f"{self.key}@{where}."  # derivatives by the open part, of which both parameters are

        def by_others(by_effects: Mapping[str, object]) -> dict[str, object]:
            return {name: slope for name, slope in by_effects.items() if not name.startswith(own)}

        return made.with_parts(tuple(replace(part, by_effects=by_others(part.by_effects)) for part in made.parts))


EFFECT = ClosingVoid()
