"""Every event the daemon publishes: its header, its topic, its frames. The words are in docs/wire.md.

An event is a multipart message: topic, JSON header, then one raw frame for each of `columns`.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias
from urllib.parse import quote

import msgspec

from ...models.base.errors import PzctlError
from ...models.build import Build
from ...models.sweep import Sweep
from .frames import MOST_FRAMES, Array, ColumnHeader, WireError, from_json, pack, to_json, unpack
from .result_messages import FitReport

WIRE = 1
"""Counts breaking changes of the wire. Readers ignore unknown fields and refuse an unknown number."""

WELCOME = b"welcome."
"""What the events socket says first to whoever subscribes to it."""

Payload: TypeAlias = tuple[bytes, ...]
"""Raw frames, in the order of a header's `columns`."""


class InstrumentInfo(msgspec.Struct, frozen=True):
    """Who measured."""

    name: str
    """The resource string."""
    idn: str
    model: str
    serial: str
    firmware: str
    simulated: bool


class SampleStep(msgspec.Struct, frozen=True):
    """What was measured: the build's name, and the gluing step."""

    name: str
    step: str


class Event(msgspec.Struct, frozen=True, kw_only=True, tag_field="kind"):
    """What all events say. `run`, `seq`, `id` and `time` are given by the journal."""

    v: int = WIRE
    run: str = ""
    """uuid7 of the daemon's run; new at each start."""
    seq: int = 0
    """Rises by one per event over all runs; a beat repeats the last one."""
    id: str = ""
    """uuid7."""
    time: str = ""
    """RFC 3339, UTC."""
    columns: tuple[ColumnHeader, ...] = ()

    @property
    def topic(self) -> bytes:
        """The first frame: kind and names, escaped, each followed by a dot."""
        return topic(str(self.__struct_config__.tag), *self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """What stands in the topic behind the kind."""
        return ()


class Sampled(Event, frozen=True, kw_only=True):
    """An event that belongs to one measurement of one sample."""

    measurement: str
    """uuid7; the same for all segments and all results of one measurement."""
    sample: SampleStep

    @property
    def names(self) -> tuple[str, ...]:
        """Sample and step."""
        return (self.sample.name, self.sample.step)


class SweepEvent(Sampled, frozen=True, kw_only=True, tag="sweep"):
    """One segment, as recorded; columns `frequency` (Hz) and `impedance` (ohm). `id` is the sweep's id."""

    instrument: InstrumentInfo
    build: Build
    """The transducer, so that whoever hears the sweep needs nothing else to fit it."""
    segment: int
    """1 .. segments."""
    segments: int
    started: str
    """When the sweep began, RFC 3339, UTC."""
    settings: dict[str, Any]
    """As read back from the instrument."""
    notes: tuple[str, ...] = ()
    decides: str | None = None
    """The measurement whose diagnosis this one is to decide; it is no record of its step then."""
    client: str | None = None
    """Who asked for the measurement: the name of their key."""
    by: str | None = None
    """For whom that client asked, as it said itself."""


class ProgressEvent(Sampled, frozen=True, kw_only=True, tag="progress"):
    """How far a measurement is."""

    fraction: float
    seconds_left: float
    what: str


class StateEvent(Event, frozen=True, kw_only=True, tag="state"):
    """Something began or ended.

    Of the daemon: `started`, `shutdown` (asked for), `stopping`, `bench` (a command of the simulated bench), `leased`,
    `released`. Of a measurement: `queued`, `measuring`, `cancelling`, then one of `measured`, `measured-aside`
    (complete, but made to decide another one's diagnosis), `failed`, `cancelled`, `abandoned`, and later, maybe,
    `withdrawn`. Of a fitter: `fitter-ready`, `fitter-ended`, `fitter-broken`.
    """

    state: str
    says: str = ""
    """A sentence for people."""
    measurement: str | None = None
    sample: SampleStep | None = None
    fitter: str | None = None
    client: str | None = None
    """Who asked for it: the name of their key. None for what happened by itself."""
    by: str | None = None
    """For whom that client asked, as it said itself."""


class FitEvent(Sampled, frozen=True, kw_only=True, tag="fit"):
    """What a fitter answered; for each of `curves` the columns `K.frequency K.measured K.start K.fitted`."""

    fitter: str
    version: str
    sweeps: tuple[str, ...]
    """Ids of the sweeps that were used."""
    report: FitReport | None = None
    error: str | None = None
    """Why there is no report, in one sentence."""
    curves: tuple[str, ...] = ()
    """The step that curve K belongs to."""

    @property
    def names(self) -> tuple[str, ...]:
        """Sample, step and fitter."""
        return (self.sample.name, self.sample.step, self.fitter)


class DiagnosisEvent(Sampled, frozen=True, kw_only=True, tag="diagnosis"):
    """What a diagnosis found: the object that `pzctl diagnose --json` prints.

    Columns as of a fit: `K.start` is the model without what was found, `K.fitted` the one with it.
    """

    fitter: str
    version: str
    sweeps: tuple[str, ...]
    diagnosis: dict[str, Any]
    curves: tuple[str, ...] = ()
    """The step that curve K belongs to."""


class BeatEvent(Event, frozen=True, kw_only=True, tag="beat"):
    """Life sign, every second; `seq` is that of the last event. Not in the journal."""


AnyEvent: TypeAlias = SweepEvent | ProgressEvent | StateEvent | FitEvent | DiagnosisEvent | BeatEvent


class Envelope(msgspec.Struct, frozen=True):
    """What is read first, so that a later wire or an unknown kind is met with words, not with a parse error."""

    KINDS: ClassVar[frozenset[str]] = frozenset({"sweep", "progress", "state", "fit", "diagnosis", "beat"})
    v: int
    kind: str
    run: str
    seq: int


@dataclass(frozen=True, eq=False)
class ReceivedEvent:
    """An event that was read: header and arrays."""

    event: AnyEvent
    arrays: dict[str, Array]

    def sweep(self) -> Sweep:
        """Return the recording of a sweep event. Raises WireError where it is none."""
        if not isinstance(self.event, SweepEvent):
            raise WireError(f"message: {type(self.event).__name__} holds no sweep")
        try:
            f, z = self.arrays["frequency"].real, self.arrays["impedance"].astype(complex)
            return Sweep(f, z, self.event.settings, self.event.started, self.event.id, self.event.notes)
        except KeyError as error:
            raise WireError(f"message: sweep {self.event.id!r} has no column {error}") from None
        except PzctlError as error:
            raise WireError(f"message: {error}") from None


_envelope = msgspec.json.Decoder(Envelope)
_event = msgspec.json.Decoder(AnyEvent)


def topic(kind: str, *names: str) -> bytes:
    """Return `kind.name.name.`; all but letters, digits, `_` and `-` is percent-escaped, so a dot only ends a name."""
    return "".join(
        quote(name, safe="").replace(".", "%2E").replace("~", "%7E") + "." for name in (kind, *names)
    ).encode()


def sweep_columns(sweep: Sweep) -> tuple[tuple[ColumnHeader, ...], Payload]:
    """Return the columns of a sweep and their bytes."""
    f, z = pack("frequency", "Hz", sweep.frequency), pack("impedance", "ohm", sweep.impedance)
    return (f[0], z[0]), (f[1], z[1])


def encode(event: Event, payload: Sequence[bytes] = ()) -> list[bytes]:
    """Return the frames of an event: topic, header, raw columns."""
    return [event.topic, to_json(event), *payload]


def envelope(frames: Sequence[bytes]) -> Envelope:
    """Return run, seq and kind. Raises WireError where it is no event, or one of another wire."""
    if not 2 <= len(frames) <= MOST_FRAMES:
        raise WireError(f"message: {len(frames)} frame(s); an event has 2 to {MOST_FRAMES}")
    found = from_json(frames[1], _envelope)
    if found.v != WIRE:
        raise WireError(f"message: this is pzctl wire {found.v}, and wire {WIRE} is read here: upgrade the older side")
    return found


def decode(frames: Sequence[bytes]) -> ReceivedEvent:
    """Return the event. Raises WireError with a sentence, whatever the bytes are."""
    found = envelope(frames)
    if found.kind not in Envelope.KINDS:
        raise WireError(f"message: kind {found.kind!r}; known are {', '.join(sorted(Envelope.KINDS))}")
    event = from_json(frames[1], _event)
    if not (event.run and event.time) or event.seq < 0:
        raise WireError("message: the header lacks run or time, or its seq is negative")
    return ReceivedEvent(event, unpack(event.columns, frames[2:]))
