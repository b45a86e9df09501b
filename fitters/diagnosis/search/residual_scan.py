"""The residual of a hypothesis, and what each of many further columns would explain of it.

Columns come in pairs: a further resonance in phase and in quadrature, a step of gain and of phase. They stand beside
all that the hypothesis can still absorb, its constants and errors, and beside those that were found before.
"""

from abc import ABC, abstractmethod
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from typing import Generic, TypeVar

import numpy as np
from scipy.linalg import cho_solve

from ....models.base.arrays import Complexes, Impedances, Reals
from ...engine.recording import Recording
from ...error_model.error_columns import Part
from ...error_model.error_sizes import ErrorSizes
from ...error_model.point_covariance import Kernel, WhitenedColumns
from ..hypotheses.hypothesis import Hypothesis

Trial = TypeVar("Trial")


@dataclass(frozen=True, eq=False)
class Absorbed:
    """Residual of a hypothesis in some of its recordings, with everything that it can still absorb there."""

    recordings: list[Recording]
    Z: list[Impedances]
    """What the hypothesis says of each of them."""
    kernel: Kernel
    columns: list[Complexes]
    """Columns of errors in units of their prior, and derivatives, for each of these recordings, shape (N, E)."""
    prior: Reals
    """Precision of these, shape (E, E)."""
    pull: Reals
    """Minus the gradient of their ln prior, shape (E,)."""
    r: list[Complexes]

    @classmethod
    def by(cls, parent: Hypothesis, steps: Collection[str], sizes: ErrorSizes, without: Collection[Part]) -> "Absorbed":
        """Return the residual in the recordings of these steps, with errors of these sizes; `without` some parts."""
        gram, every = parent.fit.gram, parent.objective.recordings
        at = [k for k, recording in enumerate(every) if recording.step in steps]
        on, d = gram.columns.present({**sizes.of_columns(), **dict.fromkeys(without, 0.0)})
        columns = [np.concatenate([gram.columns.blocks[k][:, on] * d, gram.J[k]], axis=1) for k in at]
        prior = np.zeros((columns[0].shape[1],) * 2)
        prior[: on.size, : on.size] = np.eye(on.size)
        prior[on.size :, on.size :] = gram.before.P
        pull = np.concatenate([np.zeros(on.size), gram.before.g])
        kernel = Kernel([gram.columns.points[k] for k in at], sizes.colour, sizes.rough)
        curves = parent.objective.curves(parent.fit.x)
        residual = [gram.r[k] for k in at]
        return cls([every[k] for k in at], [curves[k] for k in at], kernel, columns, prior, pull, residual)

    def beside(self, more: Sequence[Complexes]) -> "Absorbed":
        """Return the same that can absorb more columns, of unit prior, for each recording, shape (N, M)."""
        columns = [np.concatenate([new, own], axis=1) for new, own in zip(more, self.columns, strict=True)]
        count = more[0].shape[1]
        prior = np.eye(columns[0].shape[1])
        prior[count:, count:] = self.prior
        return replace(self, columns=columns, prior=prior, pull=np.concatenate([np.zeros(count), self.pull]))


@dataclass(eq=False)
class Residual(ABC, Generic[Trial]):
    """What a hypothesis leaves, in which pairs of columns are looked for."""

    absorbed: Absorbed

    @abstractmethod
    def pair(self, one: Trial, recording: Recording, Z: Impedances) -> Complexes:
        """Return the two columns of a trial in a recording, in units of their prior, shape (N, 2)."""

    def columns(self, trials: Sequence[Trial]) -> list[Complexes]:
        """Return the columns of trials in each recording, shape (N, 2T)."""
        made: list[Complexes] = []
        for recording, Z in zip(self.absorbed.recordings, self.absorbed.Z, strict=True):
            own = [self.pair(one, recording, Z) for one in trials]
            made.append(np.concatenate([np.zeros((Z.size, 0), np.complex128), *own], axis=1))
        return made

    def white(self, trials: Sequence[Trial]) -> WhitenedColumns:
        """Return the columns of trials, whitened."""
        return self.absorbed.kernel.white(self.columns(trials))

    def evidence(self, found: Sequence[Trial]) -> float:
        """Return ln evidence with these pairs, up to a constant of the recordings."""
        G = self.seen(found).squared()
        A, g = self.system(G)
        unit = np.sqrt(np.maximum(np.diag(A), 1e-300))
        S = A / unit / unit[:, None] + 1e-11 * np.eye(len(A))
        log_det = float(np.linalg.slogdet(S)[1]) + 2 * float(np.sum(np.log(unit)))
        fall = float((g / unit) @ np.linalg.solve(S, g / unit))
        return -0.5 * (float(G[-1, -1]) - fall + log_det + self.absorbed.kernel.log_det)

    def seen(self, found: Sequence[Trial]) -> WhitenedColumns:
        """Return what can be absorbed, these columns, and the residual last, whitened."""
        parts = zip(self.absorbed.columns, self.columns(found), self.absorbed.r, strict=True)
        return self.absorbed.kernel.white([np.concatenate([E, W, r[:, None]], axis=1) for E, W, r in parts])

    def system(self, G: Reals) -> tuple[Reals, Reals]:
        """Return the precision of all that is present, and minus the gradient, from products with the residual last."""
        count = len(G) - 1
        A, g = G[:-1, :-1].copy(), G[:-1, -1].copy()
        known = len(self.absorbed.prior)
        A[:known, :known] += self.absorbed.prior
        g[:known] += self.absorbed.pull
        A[range(known, count), range(known, count)] += 1.0
        return A, g


@dataclass(frozen=True, eq=False)
class _Found:
    """A pair that was found, without what everything found before it absorbs."""

    white: WhitenedColumns
    cross: Reals
    """Products with what can be absorbed, shape (E, 2)."""
    precision: Reals
    """Shape (2, 2)."""
    pull: Reals
    """Product with the residual, shape (2,)."""
    along: tuple[Reals, ...]
    """Products with the pairs found before it, each of shape (2, 2)."""


@dataclass(eq=False)
class Beside:
    """What can be absorbed beside a new pair: the errors and derivatives of a fit, and the pairs found so far.

    Every product with a new pair is reduced by them one after the other (block Cholesky), so that nothing is computed
    again when a pair is added.
    """

    seen: WhitenedColumns
    unit: Reals
    factor: Reals
    x: Reals
    """Solution for the residual, shape (E,)."""
    pairs: list[_Found]

    @classmethod
    def of(cls, residual: "Residual[Trial]") -> "Beside":
        """Return what a residual has beside the pairs to be found."""
        seen = residual.seen([])
        A, g = residual.system(seen.squared())
        unit = np.sqrt(np.maximum(np.diag(A), 1e-300))
        factor = np.asarray(np.linalg.cholesky(A / unit / unit[:, None] + 1e-11 * np.eye(len(A))), np.float64)
        found = cls(seen, unit, factor, np.zeros(0), [])
        found.x = found._solved(g[:, None])[:, 0]
        return found

    def _solved(self, right: Reals) -> Reals:
        return np.asarray(cho_solve((self.factor, True), right / self.unit[:, None]) / self.unit[:, None], np.float64)

    def scanned(self, white: WhitenedColumns) -> "Scan":
        """Return trial pairs without what is absorbed."""
        products = self.seen.times(white)
        cross = products[:-1]
        solved = self._solved(cross)
        lengths = white.pairs()
        first, second = slice(0, None, 2), slice(1, None, 2)
        scan = Scan(
            white,
            cross,
            (products[-1] - cross.T @ self.x).reshape(-1, 2),
            1 + lengths[:, 0] - np.sum(cross[:, first] * solved[:, first], axis=0),
            1 + lengths[:, 1] - np.sum(cross[:, second] * solved[:, second], axis=0),
            lengths[:, 2] - np.sum(cross[:, first] * solved[:, second], axis=0),
            solved,
            [],
        )
        for one in self.pairs:
            scan.reduce(one)
        return scan

    def add(self, white: WhitenedColumns) -> _Found:
        """Add a pair, which is what is absorbed from now on."""
        scan = self.scanned(white)
        precision = np.array([[scan.a11[0], scan.a12[0]], [scan.a12[0], scan.a22[0]]])
        self.pairs.append(_Found(white, scan.cross, precision, scan.b[0], tuple(own for _, own in scan.along)))
        return self.pairs[-1]


@dataclass(eq=False)
class Scan:
    """Trial pairs: precision and pull of both columns of each, without what is absorbed."""

    white: WhitenedColumns
    cross: Reals
    b: Reals
    a11: Reals
    a22: Reals
    a12: Reals
    solved: Reals
    along: list[tuple[_Found, Reals]]
    """Pairs by which it was reduced, with their products with the trials, shape (2, 2T)."""

    def reduce(self, one: _Found) -> None:
        """Remove what a pair absorbs."""
        product = one.white.times(self.white) - one.cross.T @ self.solved
        for (before, its), own in zip(self.along, one.along, strict=True):
            product -= own.T @ np.linalg.solve(before.precision, its)
        weighted = np.linalg.solve(one.precision, product)
        first, second = slice(0, None, 2), slice(1, None, 2)
        self.a11 = self.a11 - np.sum(product[:, first] * weighted[:, first], axis=0)
        self.a22 = self.a22 - np.sum(product[:, second] * weighted[:, second], axis=0)
        self.a12 = self.a12 - np.sum(product[:, first] * weighted[:, second], axis=0)
        self.b = self.b - (one.pull @ weighted).reshape(-1, 2)
        self.along.append((one, product))

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
