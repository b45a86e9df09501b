"""Switches of the analyzer's range: a step of gain and phase at every crossing of one level of |Z|.

A bridge measures impedances of different decades with different resistors. Each range is within the specification, but
not by the same amount, so the error is no smooth function of frequency. No device and no effect has such steps, but
effects explain them where a few crossings happen to be where they act.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ....models.base.arrays import Complexes, Impedances, Reals
from ...engine.recording import Recording
from ...error_model.error_columns import switch_columns
from ...error_model.local_error_kinds import RangeSwitch
from ..decision_rules import SWITCHES
from ..hypotheses.hypothesis import Hypothesis
from .residual_scan import Absorbed, Beside, Residual

_DECADE = float(np.log(10))
"""Distance of two ranges in ln |Z|: there is one switch in each decade, anywhere within it."""
_TRIALS = 100
"""Budget: levels tried at first."""
_FEWEST = 3
"""Fewest points on either side of a level: fewer are a glitch."""


def range_switches(parent: Hypothesis) -> tuple[RangeSwitch, ...]:
    """Return the levels of |Z| at which all recordings together show a step in what a hypothesis leaves."""
    steps = {recording.step for recording in parent.objective.recordings}
    absorbed = Absorbed.by(parent, steps, parent.fit.sizes, ("switch",))
    return tuple(_Switches(absorbed).found())


def columns_of_switches(absorbed: Absorbed, switches: Sequence[RangeSwitch]) -> list[Complexes]:
    """Return the columns of switches in recordings, shape (N, 2S)."""
    return _Switches(absorbed).columns(switches)


@dataclass(eq=False)
class _Switches(Residual[RangeSwitch]):
    """Switches of the range in what a hypothesis leaves."""

    def pair(self, one: RangeSwitch, recording: Recording, Z: Impedances) -> Complexes:
        """Return the steps of gain and phase in a recording, shape (N, 2)."""
        return switch_columns(recording, one)

    def found(self) -> list[RangeSwitch]:
        """Return the switches, found one after the other."""
        edges = self._edges()
        made: list[RangeSwitch] = []
        if edges.size < 2:
            return made
        beside = Beside.of(self)
        every = max(1, edges.size // _TRIALS)
        for _ in range(SWITCHES):
            gains = beside.scanned(self.white(_between(edges[::every]))).gains
            near = every * int(np.argmax(gains))
            own = edges[max(0, near - every) : near + 2 * every + 1]
            gains = beside.scanned(self.white(trials := _between(own))).gains
            if float(np.logaddexp.reduce(gains + np.log(np.diff(np.log(own)) / _DECADE))) < 0:
                break
            made.append(trials[int(np.argmax(gains))])
            beside.add(self.white(made[-1:]))
        return made

    def _edges(self) -> Reals:
        """Return the values of |Z| between which a level may be; steps at different levels between two are the same."""
        measured = [np.abs(one.sweep.impedance) for one in self.absorbed.recordings]
        return np.unique(np.concatenate(measured))[_FEWEST - 1 : 1 - _FEWEST]


def _between(edges: Reals) -> list[RangeSwitch]:
    return [RangeSwitch(float(level)) for level in np.sqrt(edges[:-1] * edges[1:])]
