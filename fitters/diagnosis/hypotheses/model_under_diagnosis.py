"""What the search must know of the models of the recordings, beside their impedance and its derivatives."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from ....models.base.arrays import Reals
from ....models.build import Build
from ...engine.parameters.assembly import coordinates_of, effects_of, layers_of, nominal_parameters, without_vanished
from ...engine.parameters.coordinates import Coordinates
from ...interface import Constant
from ...uncertainty.fit_result import fitted_constants


class ModelUnderDiagnosis(Protocol):
    """Coordinates of the model's parameters, and its constants. `FittedModel` is one, of any fitter."""

    def coordinates(self, steps: Sequence[str], values: Mapping[str, float]) -> Coordinates:
        """Return the coordinates of a fit without effects to recordings of these steps, starting at `values`."""
        ...

    def restart(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return values near these from which a fit can start."""
        ...

    def as_stated(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the values with all layers as the build states them."""
        ...

    def constants(
        self, steps: Sequence[str], values: Mapping[str, float], names: Sequence[str], covariance: Reals
    ) -> dict[str, Constant]:
        """Return the constants with standard uncertainties; `covariance` is that of the parameters `names`."""
        ...


@dataclass(frozen=True)
class LayeredModel:
    """The gluing steps of a build, each a stack."""

    build: Build
    free: tuple[str, ...] | None
    """Names of the constants to fit; None for all that have an uncertainty."""

    def coordinates(self, steps: Sequence[str], values: Mapping[str, float]) -> Coordinates:
        """Return the coordinates of the build's free constants."""
        return coordinates_of(self.build, steps, values, self.free)

    def restart(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the values without vanished layers."""
        return without_vanished(self.build, values)

    def as_stated(self, values: Mapping[str, float]) -> Mapping[str, float]:
        """Return the values with all layers as the build states them."""
        return {**values, **{name: one for name, one in nominal_parameters(self.build).items() if name in values}}

    def constants(
        self, steps: Sequence[str], values: Mapping[str, float], names: Sequence[str], covariance: Reals
    ) -> dict[str, Constant]:
        """Return the constants of all layers, and the parameters of the effects that the build states."""
        layers, known = layers_of(self.build, steps), effects_of(self.build, steps)
        return fitted_constants(layers, values, tuple(names), covariance, effects=known)
