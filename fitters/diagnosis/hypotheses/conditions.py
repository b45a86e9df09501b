"""Conditions of sweeps, for effects that depend on them: direction, level, speed, and time of start."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

from ....models.base.model import Model
from ....models.effects import Conditions, Device
from ....models.stack import Stack
from ....models.sweep import Sweep
from ...engine.recording import Recording

_CLOCK_IS_RIGHT = 0.3
"""A sweep faster than this part of what the instrument needs was simulated, and its clock does not count."""


def as_devices(recordings: Sequence[Recording], scale: Stack | None = None) -> tuple[Recording, ...]:
    """Return the recordings with devices in place of their models, so that effects can be added.

    `scale`: the stack that sets the scale of effects, for models that are none.
    """
    ran: dict[int, Conditions] = {}
    for step in dict.fromkeys(recording.step for recording in recordings):
        of_step = [recording.sweep for recording in recordings if recording.step == step]
        ran |= {id(sweep): one for sweep, one in zip(of_step, conditions_of(of_step), strict=True)}
    return tuple(
        replace(recording, model=_device(recording.model, ran[id(recording.sweep)], scale)) for recording in recordings
    )


def _device(model: Model, conditions: Conditions, scale: Stack | None) -> Device:
    if isinstance(model, Device):
        return replace(model, conditions=conditions)
    return Device(model, conditions=conditions, nominal=scale)


def conditions_of(sweeps: Sequence[Sweep]) -> tuple[Conditions, ...]:
    """Return the conditions of the sweeps of one step, from their settings.

    If any sweep's duration is unknown, all count as equally long.
    """
    seconds = [_seconds(sweep) for sweep in sweeps]
    known = all(seconds)
    lengths = [own / seconds[0] if known else 1.0 for own in seconds]
    spans = [float(sweep.frequency[-1] - sweep.frequency[0]) for sweep in sweeps]
    return tuple(
        Conditions(
            direction=str(sweep.settings.get("direction") or "up"),
            level_V=float(sweep.settings.get("oscillator_V") or 0.5),
            began=began,
            length=length,
            pace=span / spans[0] / length if known else 1.0,
        )
        for sweep, began, length, span in zip(sweeps, _began(sweeps, seconds, lengths), lengths, spans, strict=True)
    )


def _seconds(sweep: Sweep) -> float:
    """Return the duration of a sweep, s; 0 if it is unknown.

    The instrument's own estimate has precedence, since the clock of a simulated instrument runs differently.
    """
    return float(sweep.settings.get("estimated_seconds") or sweep.settings.get("sweep_seconds") or 0.0)


def _began(sweeps: Sequence[Sweep], seconds: Sequence[float], lengths: Sequence[float]) -> list[float]:
    """Return the start of each sweep, in durations of the first: by the clock if it is plausible, else back to back."""
    one_by_one = [sum(lengths[:k]) for k in range(len(lengths))]
    by_clock = all(
        (sweep.settings.get("sweep_seconds") or 0.0) > _CLOCK_IS_RIGHT * own
        for sweep, own in zip(sweeps, seconds, strict=True)
        if "estimated_seconds" in sweep.settings
    )
    if not by_clock or not all("estimated_seconds" in sweep.settings for sweep in sweeps):
        return one_by_one
    try:
        times = [datetime.fromisoformat(sweep.time) for sweep in sweeps]
        began = [(time - times[0]).total_seconds() / seconds[0] for time in times]
    except (ValueError, TypeError):
        return one_by_one
    return began if began == sorted(began) else one_by_one
