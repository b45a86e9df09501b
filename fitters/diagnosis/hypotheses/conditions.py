"""How the sweeps of a step ran, as far as effects of the sweep depend on it: direction, level, pace, and when."""

from collections.abc import Sequence
from dataclasses import replace
from datetime import datetime

from ....models.effects import Conditions, Device
from ....models.sweep import Sweep
from ...engine.recording import Recording

_CLOCK_IS_RIGHT = 0.3
"""A sweep that took less than this part of what the instrument needs was simulated, in a time of its own."""


def as_devices(recordings: Sequence[Recording]) -> tuple[Recording, ...]:
    """Return the recordings with devices, which effects can be added to, in place of their stacks."""
    ran: dict[int, Conditions] = {}
    for step in dict.fromkeys(recording.step for recording in recordings):
        of_step = [recording.sweep for recording in recordings if recording.step == step]
        ran |= {id(sweep): one for sweep, one in zip(of_step, conditions_of(of_step), strict=True)}
    return tuple(
        replace(recording, model=Device(recording.model, conditions=ran[id(recording.sweep)]))  # type: ignore[arg-type]
        for recording in recordings
    )


def conditions_of(sweeps: Sequence[Sweep]) -> tuple[Conditions, ...]:
    """Return how the sweeps of one step ran, from their settings.

    Where a sweep does not say how long it took, each counts for as long as any other.
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
    """Return how long a sweep took; 0 where nobody knows.

    What the instrument needs for it comes first: a clock says something else where the instrument is a simulated one.
    """
    return float(sweep.settings.get("estimated_seconds") or sweep.settings.get("sweep_seconds") or 0.0)


def _began(sweeps: Sequence[Sweep], seconds: Sequence[float], lengths: Sequence[float]) -> list[float]:
    """Return when each sweep began, in lengths of the first: by the clock where it can be trusted, else one by one."""
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
