"""Makes a recording from the instrument's data: the numbers, and all conditions under which they were taken."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from ....models.base.arrays import Impedances, Reals
from ....models.sweep import Sweep
from ....models.sweep_plan import Segment, SweepPlan
from ...base.analyzer import Identity
from ...base.per_point import gain_per_point, per_point
from ..accuracy import gain_accuracy, relative_accuracy, relative_noise
from ..capabilities import CAPABILITIES, HIGHEST_OSCILLATOR_V, LOWEST_OSCILLATOR_V
from ..protocol.settings import CONDITIONS, Value
from ..sweep_time import estimated
from .single_sweep import RawSweep
from .stitch import stitch

INDUCTIVE = (
    "The reactance is inductive at every point, and a piezoelectric device is a capacitor off its resonances: "
    "is it connected, and the polarity right?"
)
"""The note of such a recording."""


def record(raws: Sequence[RawSweep], segment: Segment, plan: SweepPlan, identity: Identity) -> Sweep:
    """Return the recording of `segment`, swept in one or several `raws`. Its settings are those read back."""
    whole = stitch([(raw.frequency, raw.impedance) for raw in raws])
    got = raws[0].settings
    bandwidth, averages = int(got["BWFACT"]), plan.point_average * plan.sweep_average
    f, z = whole.frequency, whole.impedance
    level = _level_V(got, z)
    nonzero = np.where(z == 0, 1e-3, z)  # a point of exactly 0 ohm has no relative accuracy
    settings: dict[str, Any] = {
        "instrument": identity.idn,
        "model": identity.model,
        "serial": identity.serial,
        "firmware": identity.firmware,
        "resource": identity.name,
        **_as_read_back(got, segment, plan),
        **_conditions(got),
        "source_ohm": CAPABILITIES.source_ohm,
        "started": raws[0].started,
        "ended": raws[-1].ended,
        "sweep_seconds": round(sum(raw.seconds for raw in raws), 3),
        "estimated_seconds": round(_estimated(f, bandwidth, got, plan), 3),
        "noise_relative": per_point(relative_noise(f, nonzero, bandwidth, level, averages)),
        "accuracy_relative": per_point(relative_accuracy(f, nonzero, bandwidth, level)),
        "gain_accuracy_relative": gain_per_point(gain_accuracy(f, bandwidth, level)),
    }
    if len(raws) > 1:
        settings |= _of_parts(raws, whole.noise, whole.drift)
    return Sweep(f, z, settings, raws[0].started, notes=_notes(len(raws), z))


def _estimated(frequency: Reals, bandwidth: int, got: Mapping[str, Value], plan: SweepPlan) -> float:
    """Return the time that the instrument needs for a sweep; a simulated one may take less."""
    delays = float(got["PDELT"]), float(got["SDELT"])
    return estimated(frequency, bandwidth, plan.point_average, plan.sweep_average, *delays)


def _level_V(got: Mapping[str, Value], impedance: Impedances) -> float:
    """Return the oscillator's voltage; with a set current the median over the sweep, within the allowed range."""
    level = float(got["POWE"])
    if got["POWMOD"] == "CURR":
        level *= float(np.median(np.abs(impedance)))
    return min(max(level, LOWEST_OSCILLATOR_V), HIGHEST_OSCILLATOR_V)


def _as_read_back(got: Mapping[str, Value], segment: Segment, plan: SweepPlan) -> dict[str, Any]:
    return {
        "start_Hz": segment.start_Hz,
        "stop_Hz": segment.stop_Hz,
        "points": segment.points,
        "spacing": segment.spacing,
        "direction": "down" if got["SWED"] == "DOWN" else "up",
        "oscillator_V": got["POWE"] if got["POWMOD"] == "VOLT" else None,
        "oscillator_A": got["POWE"] if got["POWMOD"] == "CURR" else None,
        "bandwidth": int(got["BWFACT"]),
        "point_average": int(got["PAVERFACT"]) if got["PAVER"] else 1,
        "sweep_average": int(got["AVERFACT"]) if got["AVER"] else 1,
        "bias_V": got["DCV"] if got["DCO"] else 0.0,
        "bias_range": got["DCRNG"] if got["DCO"] else None,
        "sweep_delay_s": got["SDELT"],
        "point_delay_s": got["PDELT"],
    }


def _conditions(got: Mapping[str, Value]) -> dict[str, Any]:
    return {
        "adapter": CAPABILITIES.adapters[str(got["E4TP"])],
        "user_calibration": got["CALST"],
        "compensation": [CONDITIONS[m].words.split()[0] for m in ("COMSTA", "COMSTB", "COMSTC") if got[m]],
    }


def _of_parts(raws: Sequence[RawSweep], noise: float | None, drift: Sequence[complex]) -> dict[str, Any]:
    return {
        "sweeps": [
            {
                "start_Hz": float(raw.frequency[0]),
                "stop_Hz": float(raw.frequency[-1]),
                "points": int(raw.frequency.size),
                "started": raw.started,
                "ended": raw.ended,
                "sweep_seconds": round(raw.seconds, 3),
            }
            for raw in raws
        ],
        "overlap_noise_relative": noise,
        "overlap_drift": [{"magnitude": step.real, "phase_rad": step.imag} for step in drift],
    }


def _notes(parts: int, impedance: Impedances) -> tuple[str, ...]:
    notes: list[str] = []
    if parts > 1:
        notes.append(f"Measured as {parts} sweeps that overlap, since a 4294A sweeps at most 801 points at once.")
    if np.all(impedance.imag > 0):
        notes.append(INDUCTIVE)
    return tuple(notes)
