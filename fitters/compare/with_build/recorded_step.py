"""Whether a recording is of the step of the build that it is said to be."""

import numpy as np

from ....models.build import Build
from ...engine.plausibility import is_absent
from ...interface import TaskError
from .found_device import FoundDevice

_AS_WELL = 2.0
"""Ratio of RMS log errors up to which a step describes a recording as well as the next one, which has more layers."""


def refuse_absent(build: Build, first: FoundDevice, earlier: str | None) -> None:
    """Raise TaskError if the recording before lacks a layer of its step; `earlier`: the step before that one."""
    values, _ = first.coordinates.forward(first.x)
    step = first.described.step
    for layer in build.layers:
        if layer.kind == "elastic" and is_absent(layer, values.get(f"{layer.name}.z", np.inf)):
            hint = f"; is it of step {earlier!r}?" if earlier else ""
            raise TaskError(
                f"the recording before is not of step {step!r} of build {build.name!r}: it shows no "
                f"{layer.name!r}{hint}"
            )


def step_doubt(first: FoundDevice, bare: FoundDevice | None) -> tuple[str, ...]:
    """Return a sentence if the recording before may be of the step before; `bare`: the device of that step in it."""
    if bare is None or bare.described.rms_log_error > _AS_WELL * first.described.rms_log_error:
        return ()
    steps = f"{bare.described.step!r} describes the recording before as well as step {first.described.step!r} does"
    return (f"Step {steps}: if it was recorded there, use --step {bare.described.step}.",)
