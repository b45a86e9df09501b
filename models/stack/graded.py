"""A piezoelectric layer whose constants change through its thickness: slices, electrically in series.

Every slice has the constants of its middle. With n slices, what a gradient does to ln Z is wrong by 1/n^2 of itself.
The charge per area is the same in all slices, so that of a graded permittivity only the mean of its inverse counts.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any, Self, TypeVar

import numpy as np

from ..base.arrays import Reals
from .layers import Elastic, Piezo
from .loss_laws import ComplexLike
from .lumps import Mass, Spring

_Layer = TypeVar("_Layer", bound=Piezo | Elastic | Spring | Mass)
SLICES = 24
"""Number of slices of a graded layer."""


@dataclass(frozen=True)
class GradedPiezo(Piezo):
    """A layer whose stiffness and h33 are linear in the depth; the stated constants are their means."""

    stiffness: float = 0.0
    """c33D at the front face less that at the back face, relative to the mean."""
    coupling: float = 0.0
    """The same of h33."""

    @classmethod
    def of(cls, layer: Piezo, stiffness: float, coupling: float) -> Self:
        """Return a layer with these gradients."""
        own: dict[str, Any] = {one.name: getattr(layer, one.name) for one in fields(Piezo)}
        return cls(**own, stiffness=stiffness, coupling=coupling)

    def replace(self, values: Mapping[str, float]) -> Self:
        """Return the layer with these parameters, and the same gradients."""
        return replace(super().replace(values), stiffness=self.stiffness, coupling=self.coupling)

    @cached_property
    def slices(self) -> tuple[Piezo, ...]:
        """The slices, back to front."""
        return tuple(
            Piezo(
                self.name,
                thickness=self.thickness / SLICES,
                density=self.density,
                c33D=self.c33D * (1 + self.stiffness * depth),
                h33=self.h33 * (1 + self.coupling * depth),
                eps33S=self.eps33S,
                polarity=self.polarity,
                c_law=self.c_law,
                h_law=self.h_law,
                eps_law=self.eps_law,
            )
            for depth in _depths().tolist()
        )

    def weights(self, of_slices: Sequence[Mapping[str, ComplexLike]]) -> dict[str, ComplexLike]:
        """Return d Z_el / d ln of the layer's quantities (d h33 itself), ohm m2, from those of its slices."""
        total = {quantity: sum(own[quantity] for own in of_slices) for quantity in of_slices[0]}
        shares = (1 + self.coupling * _depths()).tolist()
        return {**total, "h33": sum(own["h33"] * share for own, share in zip(of_slices, shares, strict=True))}


def slices_of(layer: _Layer) -> Sequence[_Layer | Piezo]:
    """Return the slices of a graded layer, back to front, or the layer itself."""
    return layer.slices if isinstance(layer, GradedPiezo) else (layer,)


def sections_by_layer(layers: Sequence[Piezo | Elastic | Spring | Mass]) -> dict[str, range]:
    """Return the positions of each layer's sections by its name."""
    made: dict[str, range] = {}
    at = 0
    for layer in layers:
        made[layer.name] = range(at, at + len(slices_of(layer)))
        at = made[layer.name].stop
    return made


def _depths() -> Reals:
    """Return the middle of each slice, from -1/2 to 1/2."""
    return (np.arange(SLICES) + 0.5) / SLICES - 0.5
