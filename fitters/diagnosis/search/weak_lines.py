"""Lines in the residual of a hypothesis: further resonances of the device.

Every device has some that are much too weak to matter: they are part of the error model, not findings. A rough error of
the same size at all frequencies describes them badly: it is too large everywhere else. Each weak line that a recording
shows therefore gets two columns of its own. A strong one is an effect, and a search for it starts here.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import log

import numpy as np
from scipy.linalg import cho_solve

from ....models.base.arrays import Complexes, Reals
from ...error_model.error_columns import WeakLine, line_columns
from ...error_model.error_sizes import ErrorSizes
from ...error_model.point_covariance import Kernel, WhitenedColumns
from ..decision_rules import LINES, SHARP
from ..hypotheses.hypothesis import Hypothesis
from ..hypotheses.problem import Problem

_QS = (SHARP, 40.0, 80.0, 160.0, 320.0)
"""Quality factors tried; broader lines are covered by the smooth errors."""
_SPACING = 0.5
"""Spacing of the trial frequencies in line widths."""
_FEWEST, _ON_A_LINE = 20, 2
"""Fewest points of a recording, and within the width of a line, that distinguish a line from noise."""
_REFINEMENTS = 5
"""Steps from a trial to the best frequency and Q beside it."""
_WEAK = 4.0
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
        return self.height <= _WEAK


def weak_lines(parent: Hypothesis) -> tuple[WeakLine, ...]:
    """Return the weak lines that the residual of a hypothesis shows, strongest first in each step."""
    steps = dict.fromkeys(recording.step for recording in parent.objective.recordings)
    return tuple(one.line for step in steps for one in _lines_of(parent, step) if one.weak)


def with_weak_lines(problem: Problem, parent: Hypothesis) -> Problem:
    """Return the problem whose error model has the weak lines that a hypothesis leaves; itself if it has them."""
    lines = weak_lines(parent)
    return problem if set(lines) == set(problem.lines) else replace(problem, lines=lines)


def strongest_lines(parent: Hypothesis, step: str, most: int) -> list[WeakLine]:
    """Return at most so many lines of any height that the residual of a hypothesis shows, strongest first.

    Rough errors would describe any line, so they do not count here.
    """
    residual = _Residual.of(parent, step, parent.fit.sizes.smooth, any_height=True)
    return [one.line for one in residual.lines(most)[0]]


def _lines_of(parent: Hypothesis, step: str) -> list[FoundLine]:
    """Return the better of two sets: in addition to the hypothesis's rough errors, and instead of them."""
    own = parent.fit.sizes
    sets = [_Residual.of(parent, step, sizes).lines() for sizes in dict.fromkeys((own, own.smooth))]
    return max(sets, key=lambda found: found[1])[0]


@dataclass(eq=False)
class _Residual:
    """Residual of a hypothesis in the recordings of one step, with everything that it can still absorb."""

    parent: Hypothesis
    step: str
    at: list[int]
    """Indices of the step's recordings."""
    kernel: Kernel
    beside: list[Complexes]
    """Columns of errors in units of their prior, and derivatives, for each of these recordings, shape (N, E)."""
    prior: Reals
    """Precision of these, shape (E, E), and minus the gradient of their ln prior, shape (E,)."""
    pull: Reals
    r: list[Complexes]
    log_K: float
    any_height: bool
    """Whether lines may be higher than weak ones."""

    @classmethod
    def of(cls, parent: Hypothesis, step: str, sizes: ErrorSizes, *, any_height: bool = False) -> "_Residual":
        """Return the residual with errors of these sizes."""
        gram = parent.fit.gram
        recordings = parent.objective.recordings
        at = [k for k, recording in enumerate(recordings) if recording.step == step]
        on, d = gram.columns.present({**sizes.of_columns(), "line": 0.0})
        beside = [np.concatenate([gram.columns.blocks[k][:, on] * d, gram.J[k]], axis=1) for k in at]
        prior = np.zeros((beside[0].shape[1],) * 2)
        prior[: on.size, : on.size] = np.eye(on.size)
        prior[on.size :, on.size :] = gram.before.P
        pull = np.concatenate([np.zeros(on.size), gram.before.g])
        kernel = Kernel([gram.columns.points[k] for k in at], sizes.colour, sizes.rough)
        return cls(parent, step, at, kernel, beside, prior, pull, [gram.r[k] for k in at], kernel.log_det, any_height)

    def lines(self, most: int = LINES) -> tuple[list[FoundLine], float]:
        """Return the lines, found one after the other, and ln evidence with them up to a constant of the step."""
        trials = self._trials()
        if not trials:
            return [], self._evidence([])
        found: list[FoundLine] = []
        beside = _Beside.of(self)
        scan = beside.scanned(self.kernel.white(self._columns([FoundLine(line) for line in trials])))
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
            scan.reduce(beside.add(self.kernel.white(self._columns(found[-1:]))))
        return found, self._evidence(found) - price

    def _refined(self, line: WeakLine, beside: "_Beside") -> FoundLine:
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
            scan = beside.scanned(self.kernel.white(self._columns(near)))
            best = int(np.argmax(scan.gains))
            found = replace(near[best], height=self._scale(near[best]) * scan.height(best))
            apart, steeper = apart / 1.6, steeper**0.7
        return found

    def _scale(self, one: FoundLine) -> float:
        """Return the standard deviation of a line's height, in that of a weak line's."""
        return one.height if self.any_height and not one.weak else 1.0

    def _trials(self) -> list[WeakLine]:
        f = np.unique(np.concatenate([self.parent.objective.recordings[k].sweep.frequency for k in self.at]))
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
        f = np.concatenate([self.parent.objective.recordings[k].sweep.frequency for k in self.at])
        return float(np.log(np.max(f) / np.min(f)))

    def _columns(self, lines: Sequence[FoundLine]) -> list[Complexes]:
        curves = self.parent.objective.curves(self.parent.fit.x)
        made: list[Complexes] = []
        for k in self.at:
            recording, Z = self.parent.objective.recordings[k], curves[k]
            own = [self._scale(one) * line_columns(recording, Z, one.line) for one in lines]
            made.append(np.concatenate([np.zeros((Z.size, 0), np.complex128), *own], axis=1))
        return made

    def _joined(self, found: Sequence[FoundLine]) -> list[Complexes]:
        more = self._columns(found)
        return [np.concatenate([E, W], axis=1) for E, W in zip(self.beside, more, strict=True)]

    def _evidence(self, found: Sequence[FoundLine]) -> float:
        G = self.seen(found).squared()
        A, g = self.system(G)
        unit = np.sqrt(np.maximum(np.diag(A), 1e-300))
        S = A / unit / unit[:, None] + 1e-11 * np.eye(len(A))
        _, log_det = np.linalg.slogdet(S)
        fall = float((g / unit) @ np.linalg.solve(S, g / unit))
        return -0.5 * (float(G[-1, -1]) - fall + log_det + 2 * float(np.sum(np.log(unit))) + self.log_K)

    def seen(self, found: Sequence[FoundLine]) -> WhitenedColumns:
        """Return what can be absorbed, these lines, and the residual last, whitened."""
        there = self._joined(found)
        return self.kernel.white([np.concatenate([E, r[:, None]], axis=1) for E, r in zip(there, self.r, strict=True)])

    def system(self, G: Reals) -> tuple[Reals, Reals]:
        """Return the precision of all that is present, and minus the gradient, from products with the residual last."""
        count = len(G) - 1
        A, g = G[:-1, :-1].copy(), G[:-1, -1].copy()
        known = len(self.prior)
        A[:known, :known] += self.prior
        g[:known] += self.pull
        A[range(known, count), range(known, count)] += 1.0
        return A, g


@dataclass(frozen=True, eq=False)
class _Line:
    """A line that was found, without what everything found before it absorbs."""

    white: WhitenedColumns
    cross: Reals
    """Products with what can be absorbed, shape (E, 2)."""
    precision: Reals
    """Shape (2, 2)."""
    pull: Reals
    """Product with the residual, shape (2,)."""
    along: tuple[Reals, ...]
    """Products with the lines found before it, each of shape (2, 2)."""


@dataclass(eq=False)
class _Beside:
    """What can be absorbed beside a new line: the errors and derivatives of a fit, and the lines found so far.

    Every product with a new line is reduced by them one after the other (block Cholesky), so that nothing is computed
    again when a line is added.
    """

    seen: WhitenedColumns
    unit: Reals
    factor: Reals
    x: Reals
    """Solution for the residual, shape (E,)."""
    lines: list[_Line]

    @classmethod
    def of(cls, residual: _Residual) -> "_Beside":
        """Return what a residual has beside lines."""
        seen = residual.seen([])
        A, g = residual.system(seen.squared())
        unit = np.sqrt(np.maximum(np.diag(A), 1e-300))
        factor = np.asarray(np.linalg.cholesky(A / unit / unit[:, None] + 1e-11 * np.eye(len(A))), np.float64)
        found = cls(seen, unit, factor, np.zeros(0), [])
        found.x = found._solved(g[:, None])[:, 0]
        return found

    def _solved(self, right: Reals) -> Reals:
        return np.asarray(cho_solve((self.factor, True), right / self.unit[:, None]) / self.unit[:, None], np.float64)

    def scanned(self, white: WhitenedColumns) -> "_Scan":
        """Return trial lines, two columns each, without what is absorbed."""
        products = self.seen.times(white)
        cross = products[:-1]
        solved = self._solved(cross)
        lengths = white.pairs()
        first, second = slice(0, None, 2), slice(1, None, 2)
        scan = _Scan(
            white,
            cross,
            (products[-1] - cross.T @ self.x).reshape(-1, 2),
            1 + lengths[:, 0] - np.sum(cross[:, first] * solved[:, first], axis=0),
            1 + lengths[:, 1] - np.sum(cross[:, second] * solved[:, second], axis=0),
            lengths[:, 2] - np.sum(cross[:, first] * solved[:, second], axis=0),
            solved,
            [],
        )
        for line in self.lines:
            scan.reduce(line)
        return scan

    def add(self, white: WhitenedColumns) -> _Line:
        """Add a line, which is what is absorbed from now on."""
        scan = self.scanned(white)
        precision = np.array([[scan.a11[0], scan.a12[0]], [scan.a12[0], scan.a22[0]]])
        self.lines.append(_Line(white, scan.cross, precision, scan.b[0], tuple(own for _, own in scan.along)))
        return self.lines[-1]


@dataclass(eq=False)
class _Scan:
    """Trial lines: precision and pull of both columns of each, without what is absorbed."""

    white: WhitenedColumns
    cross: Reals
    b: Reals
    a11: Reals
    a22: Reals
    a12: Reals
    solved: Reals
    along: list[tuple[_Line, Reals]]
    """Lines by which it was reduced, with their products with the trials, shape (2, 2T)."""

    def reduce(self, line: _Line) -> None:
        """Remove what a line absorbs."""
        product = line.white.times(self.white) - line.cross.T @ self.solved
        for (before, its), own in zip(self.along, line.along, strict=True):
            product -= own.T @ np.linalg.solve(before.precision, its)
        weighted = np.linalg.solve(line.precision, product)
        first, second = slice(0, None, 2), slice(1, None, 2)
        self.a11 = self.a11 - np.sum(product[:, first] * weighted[:, first], axis=0)
        self.a22 = self.a22 - np.sum(product[:, second] * weighted[:, second], axis=0)
        self.a12 = self.a12 - np.sum(product[:, first] * weighted[:, second], axis=0)
        self.b = self.b - (line.pull @ weighted).reshape(-1, 2)
        self.along.append((line, product))

    def height(self, trial: int) -> float:
        """Return the most probable height of a trial, in units of its columns."""
        (a, b), (c, d) = self.b[trial], (self.a12[trial], self.a11[trial] * self.a22[trial] - self.a12[trial] ** 2)
        return float(np.hypot(self.a22[trial] * a - c * b, self.a11[trial] * b - c * a) / d)

    @property
    def gains(self) -> Reals:
        """Increase of ln evidence by each trial, shape (T,)."""
        det = np.maximum(self.a11 * self.a22 - self.a12**2, 1e-12)
        b = self.b
        quadratic = (self.a22 * b[:, 0] ** 2 - 2 * self.a12 * b[:, 0] * b[:, 1] + self.a11 * b[:, 1] ** 2) / det
        return np.asarray(0.5 * quadratic - 0.5 * np.log(det), np.float64)
