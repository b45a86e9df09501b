"""Joins several segments into one recording, so that points can be dense where they are needed."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from ....models.sweep import PER_POINT, Sweep
from .sweep_record import INDUCTIVE

TIMES = ("sweep_seconds", "estimated_seconds")
_OF_ONE = ("spacing", "sweeps", "overlap_noise_relative", "overlap_drift")
"""Settings that hold for one segment only."""


def joined(sweeps: Sequence[Sweep], list_sweeps: int, no_list: str = "") -> Sweep:
    """Return the sweeps of a joined plan as one. Raises SweepError where their frequencies do not rise throughout.

    `list_sweeps`: how many list sweeps they came from, 0 where each was swept by itself; `no_list` says why.
    """
    first, last = sweeps[0], sweeps[-1]
    frequency = np.concatenate([sweep.frequency for sweep in sweeps])
    settings: dict[str, Any] = {name: value for name, value in first.settings.items() if name not in _OF_ONE}
    settings |= {name: [one for sweep in sweeps for one in sweep.settings[name]] for name in PER_POINT}
    settings |= {
        "stop_Hz": last.settings["stop_Hz"],
        "points": int(frequency.size),
        "ended": last.settings["ended"],
        "sweep_type": "list" if list_sweeps else "segment by segment",
        **({"no_list_sweep": no_list} if no_list else {}),
        **{name: round(sum(sweep.settings[name] for sweep in sweeps), 3) for name in TIMES},
        "segments": [
            {name: sweep.settings[name] for name in ("start_Hz", "stop_Hz", "points", "spacing", "started", "ended")}
            for sweep in sweeps
        ],
    }
    notes = dict.fromkeys(note for sweep in sweeps for note in sweep.notes)
    if not all(
        INDUCTIVE in sweep.notes for sweep in sweeps
    ):  # segments between a resonance and its antiresonance are inductive
        notes.pop(INDUCTIVE, None)
    impedance = np.concatenate([sweep.impedance for sweep in sweeps])
    how = f"in {list_sweeps} list sweep(s), for which its list-sweep table was overwritten"
    says = f"One recording of {len(sweeps)} segments, {how if list_sweeps else 'each swept by itself'}."
    return Sweep(frequency, impedance, settings, first.time, notes=(*notes, says))
