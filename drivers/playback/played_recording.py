"""A recording, or a folder of them, played as an analyzer: the same path for old data as for new."""

import dataclasses
from collections.abc import Callable
from pathlib import Path

from ...models.sweep import Sweep
from ...models.sweep_plan import Segment, SweepPlan
from ..base.analyzer import Cancelled, Identity, InstrumentError, Progress
from ..recordings import read_recording


class Playback:
    """Plays `path`: a file answers every plan, a folder's files (in the order of their names) one plan each.

    The points are the recorded ones, never interpolated: of each segment those that were recorded within it.
    Raises InstrumentError where there is no such file, or the folder is empty.
    """

    def __init__(self, path: Path) -> None:
        if not path.exists():
            raise InstrumentError(f"recording:{path}: there is no such file or folder")
        if not (path.is_file() or path.is_dir()):
            raise InstrumentError(f"recording:{path}: this is a device or a pipe; a file or a folder is needed")
        self._path = path
        self._files = _files(path)
        self._next = 0

    def identify(self) -> Identity:
        """Return who "answers": the recording itself."""
        name = f"recording:{self._path}"
        return Identity(name, name, "recording", "", "")

    def make_safe(self) -> None:
        """Do nothing: a recording has no bias."""

    def estimated_seconds(self, plan: SweepPlan) -> float:
        """Return 0: a recording has no sweep to wait for."""
        return 0.0

    def measure(
        self,
        plan: SweepPlan,
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> tuple[Sweep, ...]:
        """Answer `plan` by recorded points: one Sweep for each segment, or one for all that are joined.

        Raises InstrumentError where nothing was recorded within a segment, or all recordings have been played;
        Cancelled; and what reading the file raises.
        """
        if cancelled():
            raise Cancelled(f"recording:{self._path}: cancelled before it was played")
        file = self._take()
        recording = read_recording(file)
        segments = plan.segments
        if plan.joined:
            segments = (Segment(segments[0].start_Hz, segments[-1].stop_Hz),)
        sweeps = tuple(_within(recording, segment, file) for segment in segments)
        progress(Progress(1.0, 0.0, f"played {file.name}"))
        return sweeps

    def close(self) -> None:
        """Nothing to let go of."""

    def _take(self) -> Path:
        if self._path.is_file():
            return self._path
        if self._next == len(self._files):
            raise InstrumentError(f"recording:{self._path}: all {self._next} recordings of the folder have been played")
        self._next += 1
        return self._files[self._next - 1]


def _files(path: Path) -> list[Path]:
    files = [path] if path.is_file() else sorted(file for file in path.iterdir() if file.suffix.lower() in SUFFIXES)
    if not files:
        raise InstrumentError(f"recording:{path}: no recording in this folder; {' '.join(SUFFIXES)} are looked for")
    return files


SUFFIXES = (".csv", ".s1p", ".tsv", ".txt", ".y1p", ".z1p")
"""What a recording's name ends with; other files of a folder are not played."""


def _within(recording: Sweep, segment: Segment, file: Path) -> Sweep:
    f = recording.frequency
    keep = (f >= segment.start_Hz) & (f <= segment.stop_Hz)
    asked = f"{segment.start_Hz:.12g} to {segment.stop_Hz:.12g} Hz"
    if keep.sum() < 2:
        raise InstrumentError(
            f"recording:{file}: {keep.sum()} of its points lie within {asked}; it was recorded from "
            f"{f[0]:.12g} to {f[-1]:.12g} Hz"
        )
    notes = recording.notes
    if not keep.all() or f[0] > segment.start_Hz or f[-1] < segment.stop_Hz:
        notes = (*notes, f"Played from {file.name}: {keep.sum()} recorded points within {asked}.")
    return dataclasses.replace(recording, frequency=f[keep], impedance=recording.impedance[keep], notes=notes)
