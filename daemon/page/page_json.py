"""Events and fits as the JSON that the page reads. Complex numbers are two lists, `re` and `im`."""

from typing import Any

import msgspec
import numpy as np

from ...fitters.interface import Curve, FitResult
from ...models.base.arrays import Complexes
from ...models.build import Build
from ...models.sweep import Sweep
from ..client.result_waiter import fit_of
from ..report.json_output.fit_json import fit_json
from ..samples.sample_record import StepRecord
from ..wire.events import BeatEvent, FitEvent, ReceivedEvent, SweepEvent

_DIGITS = 8
"""Significant digits that a screen can use; the files hold all."""


def event_json(heard: ReceivedEvent) -> dict[str, Any]:
    """Return an event with its numbers; `kind` says which."""
    event = heard.event
    if isinstance(event, BeatEvent):
        return {"kind": "beat", "run": event.run, "seq": event.seq}
    made: dict[str, Any] = msgspec.to_builtins(event)
    for heavy in ("build", "columns", "report"):
        made.pop(heavy, None)
    if isinstance(event, SweepEvent):
        made["sweep"] = sweep_json(heard.sweep())
    if isinstance(event, FitEvent) and event.report is not None:
        made["fit"] = fitted_json(fit_of(heard), event.sample.step)
    return made


def sweep_json(sweep: Sweep) -> dict[str, Any]:
    """Return a recording: `f` in Hz, `z` in ohm."""
    return {"id": sweep.id, "time": sweep.time, "f": sweep.frequency.tolist(), "z": numbers_json(sweep.impedance)}


def fitted_json(fit: FitResult, step: str) -> dict[str, Any]:
    """Return a fit with the curves of one gluing step."""
    return fit_json(fit) | {"curves": [_curve(curve) for curve in fit.curves if curve.step == step]}


def record_json(one: StepRecord) -> dict[str, Any]:
    """Return one measurement with all that was answered to it."""
    step = one.measurement.sample.step
    return {
        "measurement": one.measurement.id,
        "sample": one.measurement.sample.name,
        "step": step,
        "time": one.measurement.time,
        "sweeps": [sweep_json(sweep) for sweep in one.sweeps],
        "fits": [fitted_json(fit, step) for fit in one.fits],
        "refusals": list(one.refusals),
        "diagnosis": one.diagnosis.diagnosis if one.diagnosis else None,
        "withdrawn": one.withdrawal.says if one.withdrawal else None,
    }


def build_json(build: Build) -> dict[str, Any]:
    """Return what the page draws and compares with: layers back to front, steps in order, data sheet."""
    return {
        "name": build.name,
        "back": build.back.name,
        "front": build.front.name,
        "layers": [
            {"name": layer.name, "kind": layer.kind, "thickness": layer.values["thickness"].re}
            for layer in build.layers
        ],
        "steps": [{"name": step.name, "layers": list(step.layers)} for step in build.steps],
        "sheet": {
            name: {"re": quantity.re, "im": quantity.im, "u": quantity.u, "u_im": quantity.u_im}
            for name, quantity in build.data_sheet.items()
        },
    }


def _curve(curve: Curve) -> dict[str, Any]:
    return {
        "f": curve.frequency.tolist(),
        "measured": numbers_json(curve.measured),
        "fitted": numbers_json(curve.fitted),
    }


def numbers_json(z: Complexes) -> dict[str, list[float]]:
    """Return complex numbers as two lists."""
    return {"re": _short(z.real), "im": _short(z.imag)}


def _short(values: Any) -> list[float]:
    """Return numbers with as many digits as a screen can use; null where there is none."""
    return [float(f"{x:.{_DIGITS}g}") if np.isfinite(x) else None for x in values.tolist()]  # type: ignore[misc]
