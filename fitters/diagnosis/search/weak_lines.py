"""Lines in the residual of a hypothesis: further resonances of the device.

Every device has some that are much too weak to matter: they are part of the error model, not findings. A rough error of
the same size at all frequencies describes them badly: it is too large everywhere else. Each weak line that a recording
shows therefore gets two columns of its own. A strong one is an effect, and a search for it starts here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np

from ....models.base.arrays import Complexes, Impedances, Reals
from ...engine.recording import Recording
from ...error_model.error_columns import line_columns
from ...error_model.error_sizes import ErrorSizes
from ...error_model.local_error_kinds import RangeSwitch, WeakLine
from ..decision_rules import LINES, SHARP
from ..hypotheses.hypothesis import Hypothesis
from .range_switches import columns_of_switches
from .residual_scan import Absorbed, Beside, Residual

_QS = (SHARP, 40.0, 80.0, 160.0, 320.0)
"""Quality factors tried; broader lines are covered by the smooth errors."""
_SPACING = 0.5
"""Spacing of the trial frequencies in line widths."""
_FEWEST, _ON_A_LINE = 20, 2
"""Fewest points of a recording, and within the width of a line, that distinguish a line from noise."""
_REFINEMENTS = 5
"""Steps from a trial to the best frequency and Q beside it."""
WEAK = 4.0
"""Standard deviations of a weak line's height (`prior_scales.LINE`); one in sixteen thousand is higher."""
_EXPECTED = 3.0
"""Prior mean of the number of lines in a recording: two ceramics in three have one to five."""


@dataclass(frozen=True)
class FoundLine:
    """A line in a residual."""

    line: WeakLine
    height: float = 1.0
    """Most probable height, in standard deviations of a weak line's."""

    @property
    def weak(self) -> bool:
        """Whether it is no higher than the lines that every device has."""
        return self.height <= WEAK


def weak_lines(parent: Hypothesis, switches: Sequence[RangeSwitch] = ()) -> tuple[WeakLine, ...]:
    """Return the weak lines that the residual of a hypothesis shows beside switches, strongest first in each step."""
    steps = dict.fromkeys(recording.step for recording in parent.objective.recordings)
    return tuple(one.line for step in steps for one in _lines_of(parent, step, switches) if one.weak)


def strongest_lines(parent: Hypothesis, step: str, most: int) -> list[WeakLine]:
    """Return at most so many lines of any height that the residual of a hypothesis shows, strongest first.

    Rough errors would describe any line, so they do not count here.
    """
    absorbed = Absorbed.by(parent, (step,), parent.fit.sizes.smooth, ("line",))
    return [one.line for one in _Lines(absorbed, step, any_height=True).lines(most)[0]]


def _lines_of(parent: Hypothesis, step: str, switches: Sequence[RangeSwitch]) -> list[FoundLine]:
    """Return the better of two sets: in addition to the hypothesis's rough errors, and instead of them."""
    own = parent.fit.sizes
    sets = [_Lines(_beside(parent, step, sizes, switches), step).lines() for sizes in dict.fromkeys((own, own.smooth))]
    return max(sets, key=lambda found: found[1])[0]


def _beside(parent: Hypothesis, step: str, sizes: ErrorSizes, switches: Sequence[RangeSwitch]) -> Absorbed:
    absorbed = Absorbed.by(parent, (step,), sizes, ("line", "switch"))
    return absorbed.beside(columns_of_switches(absorbed, switches))


@dataclass(eq=False)
class _Lines(Residual[FoundLine]):
    """Lines in what a hypothesis leaves in the recordings of one step."""

    step: str
    any_height: bool = False
    """Whether lines may be higher than weak ones."""

    def pair(self, one: FoundLine, recording: Recording, Z: Impedances) -> Complexes:
        """Return the columns of a line in a recording, in units of its height, shape (N, 2)."""
        return self._scale(one) * line_columns(recording, Z, one.line)

    def lines(self, most: int = LINES) -> tuple[list[FoundLine], float]:
        """Return the lines, found one after the other, and ln evidence with them up to a constant of the step."""
        trials = self._trials()
        if not trials:
            return [], self.evidence([])
        found: list[FoundLine] = []
        beside = Beside.of(self)
        scan = beside.scanned(self.white([FoundLine(line) for line in trials]))
        width = self._width()
        price = 0.0
        for _ in range(most):
            gains = scan.gains
            best = int(np.argmax(gains - [log(line.q) for line in trials]))
            cost = log(trials[best].q * width / _EXPECTED * np.sqrt(max(1.0, 2 * gains[best])))
            if gains[best] < cost:
                break
            found.append(self._refined(trials[best], beside))
            price += cost
            scan.reduce(beside.add(self.white(found[-1:])))
        return found, self.evidence(found) - price

    def _refined(self, line: WeakLine, beside: Beside) -> FoundLine:
        """Return the line at the frequency and with the Q nearby that raise the evidence most, with its height."""
        found = FoundLine(line)
        apart, steeper = _SPACING / 2, 2.0**0.5
        for _ in range(_REFINEMENTS):
            f, q = found.line.frequency, found.line.q
            near = [
                replace(found, line=WeakLine(self.step, f * (1 + shift * apart / q), q * stretch))
                for shift in (-1.0, 0.0, 1.0)
                for stretch in (1 / steeper, 1.0, steeper)
            ]
            scan = beside.scanned(self.white(near))
            best = int(np.argmax(scan.gains))
            found = replace(near[best], height=self._scale(near[best]) * scan.height(best))
            apart, steeper = apart / 1.6, steeper**0.7
        return found

    def _scale(self, one: FoundLine) -> float:
        """Return the standard deviation of a line's height, in that of a weak line's."""
        return one.height if self.any_height and not one.weak else 1.0

    def _trials(self) -> list[WeakLine]:
        f = np.unique(self._frequencies)
        if f.size < _FEWEST:
            return []
        u = np.log(f)
        made: list[WeakLine] = []
        for q in _QS:
            # one that is centred just outside the band shows its flank
            at = np.arange(u[0] - 1 / q, u[-1] + 1 / q, _SPACING / q)
            inside = np.clip(at, u[0] + 0.5 / q, u[-1] - 0.5 / q)
            points = np.searchsorted(u, inside + 0.5 / q) - np.searchsorted(u, inside - 0.5 / q)
            made += [WeakLine(self.step, float(np.exp(one)), q) for one in at[points >= _ON_A_LINE]]
        return made

    def _width(self) -> float:
        f = self._frequencies
        return float(np.log(np.max(f) / np.min(f)))

    @property
    def _frequencies(self) -> Reals:
        return np.concatenate([one.sweep.frequency for one in self.absorbed.recordings])
