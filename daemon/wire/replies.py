"""The daemon's answers to the `requests`, as specified in docs/wire.md.

An answer has the `id` of its request; `ok` is false for a refusal.
"""

from typing import Any

import msgspec

from .events import InstrumentInfo, SampleStep
from .metrics import TimingSummary


class FitterState(msgspec.Struct, frozen=True):
    """The state of a fitter that the daemon keeps running, or of one that said hello."""

    name: str
    state: str
    """`starting`, `ready`, `ended` (will be restarted) or `broken` (will not)."""
    version: str | None = None
    says: str = ""


class LeaseState(msgspec.Struct, frozen=True):
    """The current lease of the instrument."""

    owner: str
    until: str
    """Time at which it expires, RFC 3339, UTC."""


class BackupState(msgspec.Struct, frozen=True):
    """The scheduled backup of the journal; the times are RFC 3339, UTC."""

    to: str
    every_hours: float
    running: bool = False
    last_success: str | None = None
    last_failure: str | None = None
    failed: bool = False
    """Whether the last backup failed."""
    late: bool = False
    """Whether none has succeeded for twice the interval."""
    says: str = ""
    """What the last backup copied, or why it failed."""


class AnalyzerState(msgspec.Struct, frozen=True):
    """One of the daemon's analyzers, what it measures, and its queue."""

    name: str
    instrument: InstrumentInfo
    bench: str | None
    """`host:port` of the simulator's bench; None for a real instrument."""
    measuring: str | None
    sample: SampleStep | None
    queue: tuple[str, ...]
    lease: LeaseState | None


class Answer(msgspec.Struct, frozen=True, kw_only=True):
    """The fields of all answers; an answer without further content has only these."""

    id: str | None
    ok: bool = True


class ErrorBody(msgspec.Struct, frozen=True):
    """The reason of a refusal: a code for programs, a sentence for people, and a hint what to do."""

    code: str
    message: str
    hint: str = ""


class Refusal(Answer, frozen=True, kw_only=True):
    """The answer to a request that is refused; `ok` is false."""

    ok: bool = False
    error: ErrorBody


class HelloAnswer(Answer, frozen=True, kw_only=True):
    """The daemon, its instrument, endpoints and fitters."""

    wire: int
    version: str
    pid: int
    run: str
    seq: int
    instrument: InstrumentInfo
    events: str
    requests: str
    bench: str | None
    fitters: tuple[FitterState, ...]
    analyzers: tuple[AnalyzerState, ...] = ()
    """All analyzers that this client may use; `instrument` and `bench` are those of the first."""


class StatusAnswer(Answer, frozen=True, kw_only=True):
    """The current measurement, the queue and the fitters."""

    run: str
    seq: int
    measuring: str | None
    sample: SampleStep | None
    queue: tuple[str, ...]
    fitters: tuple[FitterState, ...]
    garbage: int
    """Number of invalid messages."""
    lease: LeaseState | None = None
    """None if the instrument is not leased."""
    backup: BackupState | None = None
    """None if no backup is scheduled."""
    analyzers: tuple[AnalyzerState, ...] = ()
    """All analyzers that this client may use; `measuring`, `sample`, `queue` and `lease` are those of the first."""


class MetricsAnswer(Answer, frozen=True, kw_only=True):
    """Counters since the daemon started, and latest durations."""

    uptime: float
    """Seconds since the daemon started."""
    counts: dict[str, int]
    """Events by kind (`sweep`, `state-measured` ...), `requests`, `refused`, `garbage`, `replayed` events, `cut-off`
    connections."""
    queue: int
    errands: int
    seconds: dict[str, TimingSummary]
    """Latest durations: `publish` (write and send an event), `request` (until its answer), `fit` (after its sweep)."""


class SettingsAnswer(Answer, frozen=True, kw_only=True):
    """The settings that the daemon was started with."""

    settings: dict[str, Any]


class MeasureAnswer(Answer, frozen=True, kw_only=True):
    """The id of the accepted measurement."""

    measurement: str
    analyzer: str = ""
    """Name of the analyzer that measures."""


class LeaseAnswer(Answer, frozen=True, kw_only=True):
    """The lease that was granted."""

    lease: str
    """Id of the lease for `measure`, `lease` and `release`; keep it secret."""
    until: str


class JobAnswer(Answer, frozen=True, kw_only=True):
    """The job was accepted or is answered already; these fields identify the event with the answer."""

    measurement: str
    fitter: str
    version: str | None
    """None if it is known only after the fitter has been loaded."""


class MissingEvents(msgspec.Struct, frozen=True):
    """A range of events that the journal no longer holds, both ends included, and the reason."""

    first: int
    last: int
    says: str

    @property
    def sentence(self) -> str:
        """A sentence for people."""
        which = f"event {self.first} is" if self.first == self.last else f"events {self.first} to {self.last} are"
        return f"{which} no longer in the journal: {self.says}"


class EventsAnswer(Answer, frozen=True, kw_only=True):
    """Events as they were published: their frames follow this header, `frames[k]` of them for event k."""

    frames: tuple[int, ...]
    more: bool = False
    """Whether the journal holds further requested events."""
    missing: tuple[MissingEvents, ...] = ()
    """For a replay: the requested events that are no longer in the journal."""
    not_kept: dict[str, str] = msgspec.field(default_factory=dict[str, str])
    """For `fits`: why the latest answer of each of these fitters could not be kept in the journal."""


class MeasuredStep(msgspec.Struct, frozen=True):
    """One measurement of a sample."""

    measurement: str
    step: str
    state: str
    time: str
    sweeps: tuple[str, ...]
    fitters: tuple[str, ...]
    """The fitters that answered with a result."""


class SampleHistory(msgspec.Struct, frozen=True):
    """All measurements of one sample, oldest first."""

    name: str
    measurements: tuple[MeasuredStep, ...]


class SamplesAnswer(Answer, frozen=True, kw_only=True):
    """The samples and their measurements."""

    samples: tuple[SampleHistory, ...]


class MeasurementsAnswer(Answer, frozen=True, kw_only=True):
    """Ids of measurements, oldest first."""

    measurements: tuple[str, ...]


class BenchAnswer(Answer, frozen=True, kw_only=True):
    """The bench's answer."""

    answer: dict[str, Any]
