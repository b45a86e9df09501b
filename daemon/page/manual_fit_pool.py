"""Manual fits for the page, in a separate process so that events and buttons never wait for them."""

from functools import lru_cache
from typing import Any, Literal, TypeAlias

import msgspec

from ...fitters.interface import Curve
from ...fitters.manual.manual_fit import Choices, ManualFit, models_for
from ...fitters.plugins import DEFAULT
from ...models.base.errors import PzctlError
from ..samples.journal_manual_fit import JournalManualFit, of_measurement
from ..samples.sample_selection import open_journal
from .page_json import fitted_json, numbers_json
from .worker_process import PATIENCE, NoAnswer, WorkerProcess

Work: TypeAlias = Literal["look", "fit", "keep"]


class ManualFitPoolError(PzctlError):
    """A manual fit gave no answer."""


class ManualFitRequest(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A request of the page: a measurement, and the choices for its fit."""

    measurement: str
    fitter: str = DEFAULT
    """The fitter that provides the model."""
    free: tuple[str, ...] | None = None
    values: dict[str, float] = {}
    bands: dict[str, tuple[tuple[float, float], ...]] = {}
    effects: tuple[tuple[str, str], ...] = ()
    by: str = ""
    """Name of the person, needed only to keep the fit."""

    @property
    def choices(self) -> Choices:
        """The choices of the request."""
        return Choices(self.free, self.values, self.bands, self.effects)


class ManualFitPool:
    """The process that computes previews and fits, started when first needed. Thread-safe."""

    def __init__(self) -> None:
        self._worker = WorkerProcess()

    def look(self, request: ManualFitRequest) -> dict[str, Any]:
        """Return adjustables, places of effects and the model's curves. Raises ManualFitPoolError, FitError."""
        return self._ask(request, "look")

    def fit(self, request: ManualFitRequest) -> dict[str, Any]:
        """Return what `look` returns after the fit, and the fit itself. Raises ManualFitPoolError, FitError."""
        return self._ask(request, "fit")

    def keep(self, request: ManualFitRequest) -> dict[str, Any]:
        """Fit again and write the result into the journal; return what `fit` returns. Raises PzctlError."""
        return self._ask(request, "keep")

    def close(self) -> None:
        """End the process."""
        self._worker.close()

    def _ask(self, request: ManualFitRequest, work: Work) -> dict[str, Any]:
        try:
            return self._worker.ask(_answer, request, work)
        except NoAnswer:
            raise ManualFitPoolError(
                f"the manual fit gave no answer within {PATIENCE:g} s, or its process ended"
            ) from None


def _answer(request: ManualFitRequest, work: Work) -> dict[str, Any]:
    """Carry out a request; runs in the pool's process."""
    journal = open_journal()
    try:
        version = (*journal.sweep_ids(request.measurement), journal.answers(request.measurement, request.fitter))
    finally:
        journal.close()
    manual_fit = _manual_fit(request.measurement, request.fitter, version)
    if work == "look":
        return _preview(manual_fit, request.choices)
    if work == "keep":
        result, fitted = manual_fit.keep(request.choices, request.by)
    else:
        result, fitted = manual_fit.fit(request.choices)
    return _preview(manual_fit, fitted) | {"fit": fitted_json(result, manual_fit.steps[-1])}


@lru_cache(4)
def _manual_fit(measurement: str, fitter: str, version: tuple[Any, ...]) -> JournalManualFit:
    """Return a cached manual fit; `version` changes with the journal's content."""
    return of_measurement(measurement, fitter)


def _preview(manual_fit: ManualFit, choices: Choices) -> dict[str, Any]:
    preview = manual_fit.look(choices)
    return {
        "fitter": manual_fit.fitter,
        "models": models_for(manual_fit.build, manual_fit.steps[-1]),
        "steps": list(manual_fit.steps),
        "places": manual_fit.places(),
        "handles": [msgspec.to_builtins(adjustable) for adjustable in preview.handles],
        "chi2_per_dof": preview.chi2_per_dof,
        "says": preview.says,
        "curves": [_model(curve) for curve in preview.curves if curve.step == manual_fit.steps[-1]],
    }


def _model(curve: Curve) -> dict[str, Any]:
    """Return the model's curve only, since the page has frequency and measurement already."""
    return {"fitted": numbers_json(curve.fitted)}
