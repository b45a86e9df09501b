"""The view of `pzctl watch`: the state of the newest measurement, or one line for each event."""

import json
from dataclasses import dataclass, field
from typing import cast

import numpy as np
from rich.console import Group, RenderableType
from rich.progress_bar import ProgressBar
from rich.text import Text

from ....fitters.interface import FitResult
from ....models.build import Build
from ....models.sweep import Sweep
from ...client.result_waiter import fit_of
from ...wire.events import DiagnosisEvent, FitEvent, ProgressEvent, ReceivedEvent, Sampled, StateEvent, SweepEvent
from ...wire.replies import MissingEvents
from .fit_tables import fit_table

_BARS = "▁▂▃▄▅▆▇█"
_WIDTH = 80


@dataclass
class Watched:
    """The state of the newest measurement, updated by each event."""

    headline: str = "waiting for a measurement"
    fraction: float = 0.0
    measurement: str = ""
    build: Build | None = None
    sweeps: list[Sweep] = field(default_factory=list[Sweep])
    fit: FitResult | None = None
    words: list[str] = field(default_factory=list[str])
    missed: list[str] = field(default_factory=list[str])
    """One sentence for each range of events that was missed and is no longer in the journal."""

    def miss(self, missing: MissingEvents) -> None:
        """Record a range of lost events."""
        self.missed.append(missing.sentence)

    def hear(self, received: ReceivedEvent) -> None:
        """Update the state with one event."""
        event = received.event
        if isinstance(event, Sampled) and event.measurement != self.measurement:
            self.measurement, self.sweeps, self.fit, self.words = event.measurement, [], None, []
        if isinstance(event, ProgressEvent):
            self.fraction = event.fraction
        if isinstance(event, SweepEvent):
            self.build = event.build
            self.sweeps.append(received.sweep())
        if isinstance(event, FitEvent) and event.report is not None:
            self.fit = fit_of(received)
            self.words = list(self.fit.says)
        if isinstance(event, DiagnosisEvent):
            self.words = [str(sentence) for sentence in event.diagnosis.get("says", ())]
        self.headline = line(received) or self.headline

    def screen(self) -> RenderableType:
        """Return the view for the terminal."""
        parts: list[RenderableType] = [Text(self.headline, "bold"), ProgressBar(1.0, self.fraction, _WIDTH)]
        for sweep in self.sweeps:
            low, high = sweep.frequency[0] / 1e6, sweep.frequency[-1] / 1e6
            parts.append(Text(f"|Z| {low:.3g} to {high:.3g} MHz\n{sparkline(sweep)}", "cyan"))
        if self.fit is not None:
            parts.append(Text(f"{self.fit.fitter}: chi2/dof {self.fit.chi2_per_dof:.3g}", "bold"))
            parts.append(fit_table(self.fit, self.build))
        parts += [Text(f"! {word}", "yellow") for word in (*self.words, *self.missed)]
        return Group(*parts)


def sparkline(sweep: Sweep, width: int = _WIDTH) -> str:
    """Return ln |Z| over frequency as `width` bars, each at the value of its points farthest from the median."""
    size = np.log(np.abs(sweep.impedance))
    middle = float(np.median(size))
    parts = np.array_split(size, min(width, size.size))
    ends = np.array([max(part, key=lambda value: abs(value - middle)) for part in parts])
    span = float(np.ptp(ends)) or 1.0
    levels = np.rint((ends - ends.min()) / span * (len(_BARS) - 1)).astype(int)
    return "".join(_BARS[level] for level in levels)


def _command(says: str) -> str:
    """Return a command to the bench, `{"command":"step","name":"ml1"}`, as words: `step, name ml1`."""
    try:
        command = json.loads(says)
    except ValueError:  # cut, as it was long
        return says
    if not isinstance(command, dict):
        return says
    words = cast("dict[str, object]", command)
    return ", ".join(str(value) if key == "command" else f"{key} {value}" for key, value in words.items())


def line(received: ReceivedEvent) -> str | None:
    """Return an event as one line, or None for a kind that is not shown."""
    event = received.event
    of = f"{event.sample.name} {event.sample.step}: " if isinstance(event, Sampled) else ""
    match event:
        case ProgressEvent():
            return f"{of}{100 * event.fraction:.0f} %, {event.what}, {event.seconds_left:.0f} s left"
        case SweepEvent():
            return f"{of}sweep {event.segment} of {event.segments} recorded, {received.sweep().frequency.size} points"
        case FitEvent(report=None):
            return f"{of}{event.fitter} gives no result: {event.error}"
        case FitEvent(report=report) if report is not None:
            return f"{of}fitted by {event.fitter}, chi2/dof {report.chi2_per_dof:.3g}"
        case DiagnosisEvent():
            return f"{of}diagnosis: {event.diagnosis.get('verdict')}"
        case StateEvent():
            who = event.fitter or (f"{event.sample.name} {event.sample.step}" if event.sample else "daemon")
            says = _command(event.says) if event.state == "bench" else event.says
            return f"{who}: {event.state}{f', {says}' if says else ''}"
        case _:
            return None
