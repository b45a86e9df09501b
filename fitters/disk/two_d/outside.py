"""Effects at the terminals of a disk, on it or in its laws, that are fitted together with it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ....models.base.arrays import Reals
from ....models.base.model import Model
from ....models.disk2d.disk_model import Disk2D
from ....models.effects import Added, Device
from ....models.stack import Stack
from ...engine.parameters.coordinates import Block, Coordinates
from ...engine.recording import Posterior


@dataclass(frozen=True, eq=False)
class Outside:
    """Effects with the coordinates of their parameters; none by default."""

    added: tuple[Added, ...] = ()
    blocks: tuple[Block, ...] = ()
    start: Mapping[str, float] = field(default_factory=dict[str, float])
    """Values of their parameters."""
    priors: tuple[Posterior, ...] = ()
    """Of their sizes."""
    nominal: Stack | None = None
    """The disk as a plate, which sets their sizes."""

    def around(self, model: Disk2D, values: Mapping[str, float]) -> Model:
        """Return the disk with these effects, which have their own among the `values`."""
        if not self.added:
            return model
        return Device(model, tuple(one.moved({**self.start, **values}) for one in self.added), nominal=self.nominal)

    def drawn(self, x: Reals, names: Sequence[str], rng: np.random.Generator) -> Reals:
        """Return coordinates with those of the effects drawn from their priors."""
        made = x.copy()
        for prior in self.priors:
            at = [names.index(name) for name in prior.names]
            made[at] = prior.mean + np.linalg.solve(prior.root, rng.normal(size=len(at)))
        return made

    def extended(self, coordinates: Coordinates) -> Coordinates:
        """Return the coordinates of a fit of the disk with these effects."""
        if not self.added:
            return coordinates
        values, _ = coordinates.forward(coordinates.x)
        names = tuple(name for block in self.blocks for name in block.coordinates)
        return Coordinates((*coordinates.blocks, *self.blocks), {**values, **self.start}, (*coordinates.free, *names))
