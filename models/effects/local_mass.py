"""`local-mass`: a solder dot or wire that loads part of a face."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..base.arrays import Reals
from ..base.face_loads import FACES, Dot, HasFaces
from ..base.model import Model
from ..stack import Elastic, Stack, Strips
from .base.added_layer import with_layer_on_piezo
from .base.assembly import Assembly, ParallelSection
from .base.effect import Effect, EffectParameter, Stage
from .base.part_of_face import FRACTION, satellite
from .base.scale import areal_mass

_HEIGHTS = tuple(np.geomspace(0.005, 3.0, 36).tolist())
"""Mass of a dot per area relative to that of the disk: 0.3 is 0.15 mm of solder on 0.5 mm of PZT. Each causes a
satellite
at its own frequency, so start values must lie closer than a linewidth for a fit to converge."""
_RIGID, _SOLDER, _SOFTEST = 1e9, 2e7, 3e6
"""Acoustic impedance of a dot that is practically rigid, of solder, and of the softest one, a resin; Rayl."""
_FLATTEST, _USUAL_DOME, _CAP = 0.05, 0.3, 1.0
"""Half range of a dot's height, relative to its mean: one that is practically flat, a usual one, a spherical cap."""
_Q = 20.0
"""Quality factor of a dot on a plate: as low as if it radiated into a wire."""
_LOSS, _LEAST, _MOST = 0.02, 1e-3, 0.3
"""Loss tangent of a dot's moduli on a disk of finite diameter, where it has sharp resonances of its own: usual one of
solder, and limits, those of a hard alloy and of a soft resin."""
_SPEED = 2800.0
"""Velocity of longitudinal waves in a dot, m/s: 2.8e3 in eutectic solder, 2.5e3 to 2.8e3 in resins. On a plate mass and
impedance determine what a dot does; on a disk of finite diameter its shape matters, too, and with this velocity its
height is mass times velocity over impedance."""

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(7)
"""Heights of a dot between -1 and 1, and twice their parts of its area: those of a cap are uniformly distributed."""


class LocalMass(Effect):
    """Y = (1 - phi) Y(free) + phi Y(with the mass): a satellite below resonance, or an inactive part of the face.

    That is a plate, which moves beside the dot as if there were none. On a disk of finite diameter the dot is a body of
    its own on the middle of a face, which it presses and shears (`HasFaces`).

    A dot is higher in its middle than at its rim, and each height has a satellite of its own: together they are wider
    and lower than one alone. The heights are uniformly distributed, as those of a spherical cap (a paraboloid) are.
    """

    name = "local-mass"
    stage = Stage.SHARES
    lies_on_faces = Dot
    says = "Part of {where} carries a mass: a solder dot, a wire, a drop of glue."
    separates = "sweep with pressure contacts before soldering, or weigh the dot"
    references = ("Sauerbrey, Z. Phys. 155 (1959) 206 (local sensitivity to mass)",)

    def places(self, stack: Stack) -> tuple[str, ...]:
        """Return both faces."""
        return FACES

    def effect_parameters(self, stack: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the loaded part of the area, and mass per area (kg/m2) and acoustic impedance (Rayl) of the load.

        A dot of little impedance is no rigid mass: it acts as Z tan(w m/Z)/w, more at high frequencies. The last one
        is the half range of its height, relative to the mean: 0 is flat, 1 a cap that ends in a sharp rim.
        """
        return (
            FRACTION,
            satellite("mass", "kg/m2", areal_mass(stack), _HEIGHTS),
            EffectParameter(
                "impedance", "Rayl", typical=_SOLDER, lower=_SOFTEST, upper=_RIGID, null=_RIGID, scan=(_SOLDER,)
            ),
            EffectParameter("dome", "1", typical=_USUAL_DOME, lower=_FLATTEST, upper=_CAP, null=_USUAL_DOME),
        )

    def parameters_in(self, model: Model, nominal: Stack, where: str) -> tuple[EffectParameter, ...]:
        """Return the same, and for a model with faces the loss tangent of the load."""
        plate = self.effect_parameters(nominal, where)
        if not isinstance(model, HasFaces):
            return plate
        return (*plate, EffectParameter("loss", "1", typical=0.01, lower=_LEAST, upper=_MOST, null=_LOSS))

    def extend(self, assembly: Assembly, where: str, values: Mapping[str, float]) -> Assembly:
        """Return the device with the free and the loaded part of the face in parallel."""
        fraction, mass, z = values["fraction"], values["mass"], values.get("impedance", _RIGID)
        dome = values.get("dome", _USUAL_DOME)
        if fraction <= 0:
            return assembly
        if not assembly.parts:
            rounded = (dome - _FLATTEST) / (_CAP - _FLATTEST)
            return assembly.on_face(where, Dot(fraction, mass, z, _SPEED, rounded, 1 / values.get("loss", _LOSS)))
        dot = Elastic(f"{self.name}@{where}", thickness=mass * _SPEED / z, z=z, c=_SPEED, q=_Q)
        heights = 1 + dome * _NODES
        own, height = f"{self.key}@{where}.", f"{dot.name}.thickness"

        def as_high(part: ParallelSection, relative: float) -> ParallelSection:
            t = dot.thickness * relative
            high = replace(part, stack=part.stack.replace({height: t}))
            return high.moving(
                {f"{own}mass": {height: t / mass}, f"{own}impedance": {height: -t / z, f"{dot.name}.z": 1.0}}
            )

        def loaded(part: ParallelSection) -> list[ParallelSection]:
            on = part.share(fraction, {f"{own}fraction": 1.0})
            on = replace(on, stack=with_layer_on_piezo(part.stack, where, dot))
            if part.strips is None:
                strips = Strips(dot.name, heights, _WEIGHTS / 2, {f"{own}dome": _by_dome})
                return [replace(as_high(on, 1.0), strips=strips)]
            return [
                as_high(on.share(weight / 2), relative).moving({f"{own}dome": {height: dot.thickness * node}})
                for node, relative, weight in zip(_NODES.tolist(), heights.tolist(), _WEIGHTS.tolist(), strict=True)
            ]

        def parted(part: ParallelSection) -> list[ParallelSection]:
            return [part.share(1 - fraction, {f"{own}fraction": -1.0}), *loaded(part)]

        return assembly.split(parted)


def _by_dome() -> tuple[Reals, Reals]:
    """Return the derivatives of the heights and of their parts of the area."""
    return _NODES, np.zeros_like(_WEIGHTS)


EFFECT = LocalMass()
