"""Events and fits as JSON for the page. Complex numbers are two lists, `re` and `im`."""

from typing import Any

import msgspec
import numpy as np

from ...fitters.interface import Curve, FitResult, is_undetermined
from ...models.base.arrays import Complexes
from ...models.build import Build
from ...models.sweep import Sweep
from ..client.result_waiter import fit_of
from ..report.json_output.fit_json import fit_json
from ..samples.sample_record import StepRecord
from ..wire.events import BeatEvent, FitEvent, ReceivedEvent, SweepEvent

_DIGITS = 8
"""Significant digits for the screen; exported files hold all digits."""


def event_json(received: ReceivedEvent) -> dict[str, Any]:
    """Return an event with its numbers; `kind` names its kind."""
    event = received.event
    if isinstance(event, BeatEvent):
        return {"kind": "beat", "run": event.run, "seq": event.seq}
    fields: dict[str, Any] = msgspec.to_builtins(event)
    for heavy in ("build", "columns", "report"):
        fields.pop(heavy, None)
    if isinstance(event, SweepEvent):
        fields["metadata"] = dict(event.build.metadata)
        fields["sweep"] = sweep_json(received.sweep())
    if isinstance(event, FitEvent) and event.report is not None:
        fields["fit"] = fitted_json(fit_of(received), event.sample.step)
    return fields


def sweep_json(sweep: Sweep) -> dict[str, Any]:
    """Return a recording with `f` in Hz and `z` in ohm."""
    return {"id": sweep.id, "time": sweep.time, "f": sweep.frequency.tolist(), "z": numbers_json(sweep.impedance)}


def fitted_json(fit: FitResult, step: str, build: Build | None = None) -> dict[str, Any]:
    """Return a fit with the curves of one gluing step, and with a verdict if the build has limits.

    `undetermined` are the names of the constants that have no value.
    """
    curves = [_curve(curve) for curve in fit.curves if curve.step == step]
    undetermined = [name for name, constant in fit.constants.items() if is_undetermined(name, constant)]
    return fit_json(fit, build) | {"curves": curves, "undetermined": undetermined}


def record_json(record: StepRecord, build: Build) -> dict[str, Any]:
    """Return one measurement with its fits, refusals and diagnosis."""
    step = record.measurement.sample.step
    return {
        "measurement": record.measurement.id,
        "sample": record.measurement.sample.name,
        "step": step,
        "time": record.measurement.time,
        "sweeps": [sweep_json(sweep) for sweep in record.sweeps],
        "fits": [fitted_json(fit, step, build) for fit in record.fits],
        "refusals": list(record.refusals),
        "diagnosis": record.diagnosis.diagnosis if record.diagnosis else None,
        "metadata": dict(record.metadata),
        "withdrawn": record.withdrawal.says if record.withdrawal else None,
    }


def build_json(build: Build) -> dict[str, Any]:
    """Return the parts of a build that the page needs: layers (back to front, thickness in m), steps, data sheet."""
    return {
        "name": build.name,
        "back": build.back.name,
        "front": build.front.name,
        "layers": [
            {
                "name": layer.name,
                "kind": layer.kind,
                "thickness": layer.values["thickness"].re,
                "poling": build.poling(layer),
            }
            for layer in build.layers
        ],
        "steps": [{"name": step.name, "layers": list(step.layers)} for step in build.steps],
        "limits": build.specification is not None,
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
    """Return numbers rounded for the screen, with None (null in JSON) for those that are not finite."""
    return [float(f"{x:.{_DIGITS}g}") if np.isfinite(x) else None for x in values.tolist()]  # type: ignore[misc]
