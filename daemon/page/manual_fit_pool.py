"""Fits by hand for the page, in one process of their own: whatever is asked there, neither events nor buttons wait."""

import os
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import lru_cache
from multiprocessing import get_context
from threading import Lock
from typing import Any, Literal, TypeAlias

import msgspec

from ...fitters.interface import Curve
from ...fitters.manual.manual_fit import Choices, ManualFit, models_for
from ...fitters.plugins import DEFAULT
from ...models.base.errors import PzctlError
from ..samples.journal_manual_fit import JournalManualFit, of_measurement
from ..samples.sample_selection import open_journal
from .page_json import fitted_json, numbers_json

Work: TypeAlias = Literal["look", "fit", "keep"]

PATIENCE = 120.0
"""Seconds that an answer may take."""
_NICE = 5
"""Below the daemon and whoever measures, above a diagnosis in the background: somebody waits for this."""


class ManualFitPoolError(PzctlError):
    """A fit by hand that came to nothing."""


class ManualFitRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """What the page sends: a measurement, and the choices made on it."""

    measurement: str
    fitter: str = DEFAULT
    """Whose model."""
    free: tuple[str, ...] | None = None
    values: dict[str, float] = {}
    bands: dict[str, tuple[tuple[float, float], ...]] = {}
    effects: tuple[tuple[str, str], ...] = ()
    by: str = ""
    """Who makes the fit, where it is to be kept."""

    @property
    def choices(self) -> Choices:
        """The choices alone."""
        return Choices(self.free, self.values, self.bands, self.effects)


class ManualFitPool:
    """The process that looks and fits; begun when it is first needed. For any number of threads."""

    def __init__(self) -> None:
        self._pool: ProcessPoolExecutor | None = None
        self._lock = Lock()

    def look(self, wish: ManualFitRequest) -> dict[str, Any]:
        """Return handles, places of effects, and the model's curves of a wish. Raises HandError, FitError."""
        return self._ask(wish, "look")

    def fit(self, wish: ManualFitRequest) -> dict[str, Any]:
        """Return the fit of a wish, and the handles where it has brought them. Raises HandError, FitError."""
        return self._ask(wish, "fit")

    def keep(self, wish: ManualFitRequest) -> dict[str, Any]:
        """Fit once more and write it into the journal; return what `fit` returns. Raises PzctlError."""
        return self._ask(wish, "keep")

    def close(self) -> None:
        """End the process."""
        with self._lock:
            pool, self._pool = self._pool, None
        if pool is not None:
            _end(pool)

    def _ask(self, wish: ManualFitRequest, work: Work) -> dict[str, Any]:
        with self._lock:
            pool = self._pool = self._pool or _begun()
        try:
            return pool.submit(_answer, wish, work).result(PATIENCE)
        except (BrokenProcessPool, TimeoutError):
            with self._lock:
                self._pool = None if self._pool is pool else self._pool
            _end(pool)
            raise ManualFitPoolError(
                f"the fit by hand gave no answer within {PATIENCE:g} s, or its process ended"
            ) from None


def _begun() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, get_context("spawn"), initializer=_polite)


def _end(pool: ProcessPoolExecutor) -> None:
    """End a pool at once; what it works on is nobody's any more."""
    processes: dict[int, Any] = getattr(pool, "_processes", None) or {}
    workers = [*processes.values()]
    pool.shutdown(wait=False, cancel_futures=True)
    for worker in workers:
        worker.terminate()


def _polite() -> None:
    if hasattr(os, "nice"):
        os.nice(_NICE)


def _answer(wish: ManualFitRequest, work: Work) -> dict[str, Any]:
    """Do the work, within the process."""
    journal = open_journal()
    try:
        version = (*journal.sweep_ids(wish.measurement), journal.answers(wish.measurement, wish.fitter))
    finally:
        journal.close()
    hand = _in_hand(wish.measurement, wish.fitter, version)
    if work == "look":
        return _looked(hand, wish.choices)
    result, there = hand.keep(wish.choices, wish.by) if work == "keep" else hand.fit(wish.choices)
    made = fitted_json(result, hand.steps[-1])
    return _looked(hand, there) | {"fit": made}


@lru_cache(4)
def _in_hand(measurement: str, fitter: str, version: tuple[Any, ...]) -> JournalManualFit:
    return of_measurement(measurement, fitter)


def _looked(hand: ManualFit, choices: Choices) -> dict[str, Any]:
    look = hand.look(choices)
    return {
        "fitter": hand.fitter,
        "models": models_for(hand.build, hand.steps[-1]),
        "steps": list(hand.steps),
        "places": hand.places(),
        "handles": [msgspec.to_builtins(one) for one in look.handles],
        "chi2_per_dof": look.chi2_per_dof,
        "says": look.says,
        "curves": [_model(curve) for curve in look.curves if curve.step == hand.steps[-1]],
    }


def _model(curve: Curve) -> dict[str, Any]:
    """Return the model alone: the page has frequency and measurement already."""
    return {"fitted": numbers_json(curve.fitted)}
