"""Playback of a recording, or a folder of them, as an analyzer, so that old data take the same path as new ones."""

import dataclasses
import math
import sys
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np

from ...models.sweep import Sweep
from ...models.sweep_plan import BANDWIDTHS, Segment, SweepPlan
from ..base.analyzer import Cancelled, FileKind, Identity, InstrumentError, Progress
from ..base.capabilities import Capabilities
from ..base.compensation import Compensation, Standard
from ..base.driver import PrefixDriver
from ..recordings import read_recording

PREFIX = "recording:"

CAPABILITIES = Capabilities(
    model="recording",
    frequency_Hz=(0.0, math.inf),
    oscillator_V=(0.0, math.inf),
    oscillator_A=(0.0, math.inf),
    bias_V=(-math.inf, math.inf),
    points_per_sweep=sys.maxsize,
    segments_per_sweep=sys.maxsize,
    bandwidths=BANDWIDTHS,
    averages=sys.maxsize,
    delay_s=math.inf,
    source_ohm=0.0,
    noise=lambda plan, frequency, impedance: np.zeros(frequency.size),
    accuracy=lambda plan, frequency, impedance: np.zeros(frequency.size),
    points_seconds=lambda plan, frequency: 0.0,
    setup_seconds=0.0,
)
"""Any plan is answered at once by recorded points, without added noise or error."""


class Playback:
    """Plays back `path`: a file answers every plan; the files of a folder answer one plan each, in order of name.

    Each segment gets the points recorded within it, never interpolated ones. Raises InstrumentError if there is no such
    file, or the folder is empty.
    """

    def __init__(self, path: Path) -> None:
        if not path.exists():
            raise InstrumentError(f"recording:{path}: no such file or folder")
        if not (path.is_file() or path.is_dir()):
            raise InstrumentError(f"recording:{path}: this is a device or a pipe; a file or a folder is needed")
        self._path = path
        self._files = _files(path)
        self._next = 0

    @property
    def capabilities(self) -> Capabilities:
        """Capabilities without limits, since a plan only selects recorded points."""
        return CAPABILITIES

    def identify(self) -> Identity:
        """Return the recording itself as identity."""
        name = f"recording:{self._path}"
        return Identity(name, name, "recording", "", "")

    def make_safe(self) -> None:
        """Do nothing: a recording has no bias."""

    def estimated_seconds(self, plan: SweepPlan) -> float:
        """Return 0, since playback takes no time."""
        return 0.0

    def measure(
        self,
        plan: SweepPlan,
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> tuple[Sweep, ...]:
        """Return recorded points for `plan`: one Sweep per segment, or a single one for a joined plan.

        Raises InstrumentError if nothing was recorded within a segment or all recordings have been played, Cancelled,
        and what reading the file raises.
        """
        if cancelled():
            raise Cancelled(f"recording:{self._path}: cancelled before playback")
        file = self._take()
        recording = read_recording(file)
        segments = plan.segments
        if plan.joined:
            segments = (Segment(segments[0].start_Hz, segments[-1].stop_Hz),)
        sweeps = tuple(_within(recording, segment, file) for segment in segments)
        progress(Progress(1.0, 0.0, f"played {file.name}"))
        return sweeps

    def compensate(
        self,
        standards: Sequence[Standard],
        prompt: Callable[[str], None],
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
        adapter: str = "OFF",
    ) -> Compensation:
        """Raise InstrumentError: there is no fixture."""
        raise self._no_fixture()

    def restore(self, stored: Compensation) -> None:
        """Raise InstrumentError: there is no fixture."""
        raise self._no_fixture()

    def fetch(self, kind: FileKind) -> bytes:
        """Raise InstrumentError: there is no screen."""
        raise self._no_fixture()

    def close(self) -> None:
        """Do nothing: no connection is open."""

    def _no_fixture(self) -> InstrumentError:
        return InstrumentError(f"{PREFIX}{self._path}: a recording has no fixture and no screen; name an instrument")

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
        raise InstrumentError(f"recording:{path}: no recording in this folder; {' '.join(SUFFIXES)} are allowed")
    return files


SUFFIXES = (".csv", ".s1p", ".tsv", ".txt", ".y1p", ".z1p")
"""File name extensions of recordings; other files of a folder are ignored."""


def _within(recording: Sweep, segment: Segment, file: Path) -> Sweep:
    f = recording.frequency
    keep = (f >= segment.start_Hz) & (f <= segment.stop_Hz)
    range_ = f"{segment.start_Hz:.12g} to {segment.stop_Hz:.12g} Hz"
    if keep.sum() < 2:
        raise InstrumentError(
            f"recording:{file}: {keep.sum()} of its points lie within {range_}; it was recorded from "
            f"{f[0]:.12g} to {f[-1]:.12g} Hz"
        )
    notes = recording.notes
    if not keep.all() or f[0] > segment.start_Hz or f[-1] < segment.stop_Hz:
        notes = (*notes, f"Played from {file.name}: {keep.sum()} recorded points within {range_}.")
    return dataclasses.replace(recording.at(keep), notes=notes)


DRIVER = PrefixDriver("a recording (recording:FILE)", PREFIX, lambda path: Playback(Path(path).expanduser()))
