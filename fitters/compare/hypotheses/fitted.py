"""A hypothesis fitted to a pair: its evidence, sizes, and whether its names fit its sizes."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from ....models.base.arrays import Reals
from ..errors.linearised import Linearised, Outcome
from ..errors.pair_errors import PairErrors
from ..errors.reported_sizes import sized
from ..known_changes.device_changes import NewResonance
from ..known_changes.two_ports import TwoPort
from ..levels.drive_levels import AmplitudeDependent
from ..with_build.model_change import ModelChange
from .hypothesis import Hypothesis, exact

_IMPOSSIBLE = 1e6
"""Ln odds against a change whose name does not fit its sizes, or none of whose sizes is determined."""
_SIGMAS = 2.5
_UNSEEN = 0.35
"""Relative uncertainty of a change's main size above which the change counts as undetermined."""


@dataclass(frozen=True, eq=False)
class Fitted:
    """A hypothesis with its evidence from the pair."""

    hypothesis: Hypothesis
    x: Reals
    at: Linearised
    outcome: Outcome
    errors: PairErrors
    """With the resonances at their drifted frequencies."""

    @property
    def log_posterior(self) -> float:
        """Ln of evidence times prior odds."""
        return self.weight(1.0)

    def weight(self, coarseness: float) -> float:
        """Return ln of evidence times prior odds if this much ln evidence counts as one nat."""
        against = 0.0 if self.possible else _IMPOSSIBLE
        return self.outcome.log_evidence / coarseness + self.hypothesis.log_prior - against

    @cached_property
    def shortfall(self) -> float:
        """Ln likelihood missing relative to an explanation that leaves only noise and usual errors."""
        return self.errors.shortfall(self.at, self.outcome)

    @cached_property
    def unexplained(self) -> float:
        """Root mean square of ln Z that neither the changes nor usual errors describe."""
        return float(np.sqrt(np.mean(np.abs(self.errors.unexplained(self.at, self.outcome)) ** 2)))

    @cached_property
    def possible(self) -> bool:
        """Whether the name of each change fits its sizes, before and after the last step, and these are known."""
        f = self.at.frequency
        return all(self._seen(k) for k in range(len(self.hypothesis.changes))) and all(
            not isinstance(change, TwoPort | NewResonance)
            or change.possible is None
            or change.possible(f, self.hypothesis.values(x, k))
            for k, change in enumerate(self.hypothesis.changes)
            for x in (self.x, self.outcome.total)
        )

    def _seen(self, k: int) -> bool:
        change, own = self.hypothesis.changes[k], self.hypothesis.slices[k]
        if not change.sizes:
            return True
        if change.sizes[0].signed:
            own = slice(own.start, own.start + 2) if isinstance(change, AmplitudeDependent) else own  # not the exponent
            sd = np.sqrt(np.maximum(np.diag(self.outcome.covariance)[own], 0.0))
            return bool(np.any(np.abs(self.outcome.total[own]) > _SIGMAS * sd))
        main = slice(own.start, own.start + (change.main if isinstance(change, ModelChange) else 1))
        spreads = np.array([size.spread for size in change.sizes[: main.stop - main.start]])
        relative = spreads[:, None] * self.outcome.covariance[main, main] * spreads
        one = np.ones(spreads.size)
        # of one size, 1/u2; of several, that of their best known combination
        return not spreads.size or float(one @ np.linalg.pinv(relative, hermitian=True) @ one) > _UNSEEN**-2

    def sizes(self, k: int) -> Mapping[str, tuple[float, float, str]]:
        """Return value, standard uncertainty and unit of the sizes of change `k`."""
        change, own = self.hypothesis.changes[k], self.hypothesis.slices[k]
        total, covariance = self.reported
        sd = np.sqrt(np.maximum(np.diag(covariance)[own], 0.0))
        return {
            size.name: (size.value(float(x)), float(abs(size.slope(float(x))) * u), size.unit)
            for size, x, u in zip(change.sizes, total[own], sd, strict=True)
        }

    @cached_property
    def reported(self) -> tuple[Reals, Reals]:
        """The coordinates that are reported and their covariance, shapes (P,) and (P, P).

        The main size of a two-port is that in the middle of the band; of a change in the device, the one that fits
        the whole band best.
        """
        pairs = zip(self.hypothesis.changes, self.hypothesis.slices, strict=True)
        main = [
            (own.start, 1 / change.sizes[0].spread if exact(change) else 0.0) for change, own in pairs if change.sizes
        ]
        total, covariance = sized(self.errors, self.at, self.outcome, main)
        for change, own in zip(self.hypothesis.changes, self.hypothesis.slices, strict=True):
            if isinstance(change, AmplitudeDependent):
                covariance[own, own] += change.covariance
        return total, covariance
