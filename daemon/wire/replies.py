"""What the daemon answers to what `requests` asks. The words are in docs/wire.md.

An answer carries the `id` of its request; `ok` says whether it is one, or a refusal.
"""

from typing import Any

import msgspec

from .events import InstrumentInfo, SampleStep
from .metrics import TimingSummary


class FitterState(msgspec.Struct, frozen=True):
    """One fitter the daemon keeps, or one that said hello."""

    name: str
    state: str
    """`starting`, `ready`, `ended` (it will be started again) or `broken` (it will not)."""
    version: str | None = None
    says: str = ""


class LeaseState(msgspec.Struct, frozen=True):
    """Who has the instrument to themselves."""

    owner: str
    until: str
    """RFC 3339, UTC; it expires then."""


class Answer(msgspec.Struct, frozen=True, kw_only=True):
    """What all answers say; this alone where there is nothing to add."""

    id: str | None
    ok: bool = True


class ErrorBody(msgspec.Struct, frozen=True):
    """Why not: a word for programs, a sentence for people, and what to do."""

    code: str
    message: str
    hint: str = ""


class Refusal(Answer, frozen=True, kw_only=True):
    """The answer to a request that cannot be met; `ok` is false."""

    ok: bool = False
    error: ErrorBody


class HelloAnswer(Answer, frozen=True, kw_only=True):
    """Who is there."""

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


class StatusAnswer(Answer, frozen=True, kw_only=True):
    """What is going on."""

    run: str
    seq: int
    measuring: str | None
    sample: SampleStep | None
    queue: tuple[str, ...]
    fitters: tuple[FitterState, ...]
    garbage: int
    """Messages that were no request."""
    lease: LeaseState | None = None
    """None where nobody has the instrument to themselves."""


class MetricsAnswer(Answer, frozen=True, kw_only=True):
    """What was counted and timed since the daemon began."""

    uptime: float
    """Seconds."""
    counts: dict[str, int]
    """Events by kind (`sweep`, `state-measured` ...), `requests`, `refused`, `garbage`, `replayed` events, `cut-off`
    connections."""
    queue: int
    errands: int
    seconds: dict[str, TimingSummary]
    """Lately: `publish` (an event kept and said), `request` (until its answer), `fit` (after its sweep)."""


class SettingsAnswer(Answer, frozen=True, kw_only=True):
    """How the daemon was started."""

    settings: dict[str, Any]


class MeasureAnswer(Answer, frozen=True, kw_only=True):
    """Accepted."""

    measurement: str


class LeaseAnswer(Answer, frozen=True, kw_only=True):
    """The instrument is yours."""

    lease: str
    """To be named by `measure`, `lease` and `release`; keep it to yourself."""
    until: str


class JobAnswer(Answer, frozen=True, kw_only=True):
    """Accepted, or answered before: what the events that carry the answer are known by."""

    measurement: str
    fitter: str
    version: str | None
    """None where it is known only once the fitter has been loaded."""


class MissingEvents(msgspec.Struct, frozen=True):
    """Events that the journal no longer holds, both ends included, and why."""

    first: int
    last: int
    says: str

    @property
    def sentence(self) -> str:
        """What people are told."""
        which = f"event {self.first} is" if self.first == self.last else f"events {self.first} to {self.last} are"
        return f"{which} no longer in the journal: {self.says}"


class EventsAnswer(Answer, frozen=True, kw_only=True):
    """Events as they were published: behind this header stand all their frames, `frames[k]` of them for event k."""

    frames: tuple[int, ...]
    more: bool = False
    """The journal holds further events of what was asked for."""
    missing: tuple[MissingEvents, ...] = ()
    """Of a replay: what was asked for and is no longer there."""


class MeasuredStep(msgspec.Struct, frozen=True):
    """One measurement of a sample."""

    measurement: str
    step: str
    state: str
    time: str
    sweeps: tuple[str, ...]
    fitters: tuple[str, ...]
    """Those that answered with a result."""


class SampleHistory(msgspec.Struct, frozen=True):
    """All that was measured of one sample, oldest first."""

    name: str
    measurements: tuple[MeasuredStep, ...]


class SamplesAnswer(Answer, frozen=True, kw_only=True):
    """Which samples were measured."""

    samples: tuple[SampleHistory, ...]


class MeasurementsAnswer(Answer, frozen=True, kw_only=True):
    """Ids of measurements, oldest first."""

    measurements: tuple[str, ...]


class BenchAnswer(Answer, frozen=True, kw_only=True):
    """What the bench answered."""

    answer: dict[str, Any]
