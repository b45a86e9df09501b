"""`local-mass`: a solder dot or wire that loads part of a face."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..stack import Mass, Stack
from .base.assembly import Assembly, ParallelSection
from .base.effect import FACES, Effect, EffectParameter, Stage
from .base.scale import areal_mass
from .electrode_mass import with_mass

_HEIGHTS = tuple(np.geomspace(0.005, 3.0, 36).tolist())
"""Mass of a dot per area relative to that of the disk: 0.3 is 0.15 mm of solder on 0.5 mm of PZT. Each causes a
satellite
at its own frequency, so start values must lie closer than a linewidth for a fit to converge."""
_RESTING = 0.3
"""The same while the effect is absent."""


class LocalMass(Effect):
    """Y = (1 - phi) Y(free) + phi Y(with the mass): a satellite below resonance, or an inactive part of the face."""

    name = "local-mass"
    stage = Stage.SHARES
    says = "Part of {where} carries a mass: a solder dot, a wire, a drop of glue."
    separates = "sweep with pressure contacts before soldering, or weigh the dot"
    references = (
        "left-out physics 4.2 (parts of the face as plates side by side)",
        "Sauerbrey, Z. Phys. 155 (1959) 206 (local sensitivity to mass)",
    )

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both faces."""
        return FACES

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the loaded part of the area, and the mass per area there, kg/m2."""
        unit = areal_mass(stack)
        scan = tuple(height * unit for height in _HEIGHTS)
        return (
            EffectParameter("fraction", "1", typical=0.01, upper=0.5, prior=(0.03, 1.3)),
            EffectParameter(
                "mass",
                "kg/m2",
                typical=0.1 * unit,
                lower=1e-3 * unit,
                upper=100 * unit,
                null=_RESTING * unit,
                scan=scan,
            ),
        )

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the free and the loaded part of the face in parallel."""
        fraction, mass = values["fraction"], Mass(f"{self.name}@{where}", values["mass"])
        if fraction <= 0:
            return assembly

        def parted(part: ParallelSection) -> tuple[ParallelSection, ParallelSection]:
            loaded = with_mass(part.stack, where, mass)
            return (
                replace(part, fraction=part.fraction * (1 - fraction)),
                replace(part, fraction=part.fraction * fraction, stack=loaded),
            )

        return assembly.split(parted)


EFFECT = LocalMass()
