"""The events that the daemon publishes: headers, topics and frames, as specified in docs/wire.md.

An event is a multipart message: topic, JSON header, then one raw frame for each of `columns`.
"""

import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, TypeAlias
from urllib.parse import quote

import msgspec

from ...models.base.errors import PzctlError
from ...models.build import Build
from ...models.sweep import Sweep
from .frames import (
    LARGEST_FRAME,
    LARGEST_WRITTEN,
    MOST_FRAMES,
    Array,
    ColumnHeader,
    WireError,
    from_json,
    pack,
    to_json,
    unpack,
)
from .result_messages import FitReport

WIRE = 1
"""Version of the wire, raised by breaking changes. Readers ignore unknown fields and refuse an unknown version."""

WELCOME = b"welcome."
"""The first message of the events socket to a new subscriber."""

Payload: TypeAlias = tuple[bytes, ...]
"""Raw frames, in the order of a header's `columns`."""


class InstrumentInfo(msgspec.Struct, frozen=True):
    """The analyzer that measured."""

    name: str
    """Its resource string."""
    idn: str
    model: str
    serial: str
    firmware: str
    simulated: bool


class SampleStep(msgspec.Struct, frozen=True):
    """A sample at a step: the build's name and the gluing step."""

    name: str
    step: str


class Event(msgspec.Struct, frozen=True, kw_only=True, tag_field="kind"):
    """The fields of all events. The journal sets `run`, `seq`, `id` and `time`."""

    v: int = WIRE
    run: str = ""
    """uuid7 of the daemon's run; new at each start."""
    seq: int = 0
    """Number of the event, counted over all runs; a beat repeats the last one."""
    id: str = ""
    """uuid7."""
    time: str = ""
    """RFC 3339, UTC."""
    columns: tuple[ColumnHeader, ...] = ()

    @property
    def topic(self) -> bytes:
        """The first frame: kind and names, escaped, each with a dot after it."""
        return topic(str(self.__struct_config__.tag), *self.names)

    @property
    def names(self) -> tuple[str, ...]:
        """The names in the topic, after the kind."""
        return ()


class Sampled(Event, frozen=True, kw_only=True):
    """An event that belongs to one measurement of one sample."""

    measurement: str
    """uuid7, the same for all segments and all results of one measurement."""
    sample: SampleStep

    @property
    def names(self) -> tuple[str, ...]:
        """Sample and step."""
        return (self.sample.name, self.sample.step)


class SweepEvent(Sampled, frozen=True, kw_only=True, tag="sweep"):
    """One segment, as recorded; columns `frequency` (Hz) and `impedance` (ohm). `id` is the sweep's id."""

    instrument: InstrumentInfo
    build: Build
    """The transducer, so that a fitter needs nothing else."""
    segment: int
    """1 .. segments."""
    segments: int
    started: str
    """Start of the sweep, RFC 3339, UTC."""
    settings: dict[str, Any]
    """As read back from the instrument."""
    notes: tuple[str, ...] = ()
    decides: str | None = None
    """The measurement whose diagnosis this one helps to decide; such a sweep does not count as the step's own."""
    analyzer: str = ""
    """Name of the analyzer in the daemon's settings."""
    client: str | None = None
    """Name of the key of the client that requested the measurement."""
    by: str | None = None
    """The user for whom the client asked, as the client states."""


class ProgressEvent(Sampled, frozen=True, kw_only=True, tag="progress"):
    """The progress of a measurement."""

    fraction: float
    seconds_left: float
    what: str


class StateEvent(Event, frozen=True, kw_only=True, tag="state"):
    """A change of state.

    The daemon's states: `started`, `shutdown` (requested), `stopping`, `bench` (a command to the simulated bench),
    `leased`, `released`, `backup-done`, `backup-failed`. A measurement's states: `queued`, `measuring`, `cancelling`,
    then one of `measured`, `measured-aside` (complete, but made to decide the diagnosis of another), `failed`,
    `cancelled`, `abandoned`, and possibly `withdrawn` later. A fitter's states: `fitter-ready`, `fitter-ended`,
    `fitter-broken`.
    """

    state: str
    says: str = ""
    """A sentence for people."""
    measurement: str | None = None
    sample: SampleStep | None = None
    fitter: str | None = None
    analyzer: str = ""
    """Name of the analyzer, for a state of one."""
    client: str | None = None
    """Name of the key of the client that requested it; None if nobody did."""
    by: str | None = None
    """The user for whom the client asked, as the client states."""


class FitEvent(Sampled, frozen=True, kw_only=True, tag="fit"):
    """A fitter's answer; for each of `curves` the columns `K.frequency K.measured K.start K.fitted`."""

    fitter: str
    version: str
    sweeps: tuple[str, ...]
    """Ids of the sweeps used."""
    report: FitReport | None = None
    error: str | None = None
    """The reason if there is no report, in one sentence."""
    curves: tuple[str, ...] = ()
    """The step that curve K belongs to."""

    @property
    def names(self) -> tuple[str, ...]:
        """Sample, step and fitter."""
        return (self.sample.name, self.sample.step, self.fitter)


class DiagnosisEvent(Sampled, frozen=True, kw_only=True, tag="diagnosis"):
    """A diagnosis: the object that `pzctl diagnose --json` prints.

    Columns as for a fit: `K.start` is the model without the findings, `K.fitted` the model with them; `K.explained`, if
    there is one, is the model with the most probable errors of instrument and device too.
    """

    fitter: str
    version: str
    sweeps: tuple[str, ...]
    diagnosis: dict[str, Any]
    curves: tuple[str, ...] = ()
    """The step that curve K belongs to."""


class BeatEvent(Event, frozen=True, kw_only=True, tag="beat"):
    """A sign of life every second, with the `seq` of the last event. Not in the journal."""


AnyEvent: TypeAlias = SweepEvent | ProgressEvent | StateEvent | FitEvent | DiagnosisEvent | BeatEvent


class Envelope(msgspec.Struct, frozen=True):
    """The fields to read first, so that another wire version or an unknown kind gives a clear error."""

    KINDS: ClassVar[frozenset[str]] = frozenset({"sweep", "progress", "state", "fit", "diagnosis", "beat"})
    v: int
    kind: str
    run: str
    seq: int


@dataclass(frozen=True, eq=False)
class ReceivedEvent:
    """A received event: header and arrays."""

    event: AnyEvent
    arrays: dict[str, Array]

    def sweep(self) -> Sweep:
        """Return the recording of a sweep event. Raises WireError if it is another kind or not valid."""
        if not isinstance(self.event, SweepEvent):
            raise WireError(f"message: {type(self.event).__name__} holds no sweep")
        try:
            f, z = self.arrays["frequency"].real, self.arrays["impedance"].astype(complex)
            return Sweep(f, z, self.event.settings, self.event.started, self.event.id, self.event.notes)
        except KeyError as error:
            raise WireError(f"message: sweep {self.event.id!r} has no column {error}") from None
        except PzctlError as error:
            raise WireError(f"message: {error}") from None


_SEQ = re.compile(rb'\{"kind":"[a-z]{1,20}","v":1,"run":"[-0-9a-f]{1,40}","seq":(\d{1,18}),')
"""The beginning of every header, as `encode` writes it."""

_envelope = msgspec.json.Decoder(Envelope)
_event = msgspec.json.Decoder(AnyEvent)


def topic(kind: str, *names: str) -> bytes:
    """Return `kind.name.name.`; other characters than letters, digits, `_` and `-` in a name are percent-escaped."""
    return "".join(
        quote(name, safe="").replace(".", "%2E").replace("~", "%7E") + "." for name in (kind, *names)
    ).encode()


def sweep_columns(sweep: Sweep) -> tuple[tuple[ColumnHeader, ...], Payload]:
    """Return the columns of a sweep and their bytes."""
    f, z = pack("frequency", "Hz", sweep.frequency), pack("impedance", "ohm", sweep.impedance)
    return (f[0], z[0]), (f[1], z[1])


def encode(event: Event, payload: Sequence[bytes] = ()) -> list[bytes]:
    """Return the frames of an event: topic, header, raw columns. Raises WireError if no reader would accept them."""
    frames = [event.topic, to_json(event), *payload]
    if len(frames) > MOST_FRAMES:
        raise WireError(f"event: {len(frames)} frames; at most {MOST_FRAMES} are allowed")
    if (longest := max(map(len, frames[1:]))) > LARGEST_WRITTEN:
        what = "header" if longest == len(frames[1]) else "column"
        raise WireError(f"event: a {what} of {longest} bytes; at most {LARGEST_WRITTEN} are allowed")
    return frames


def envelope(frames: Sequence[bytes]) -> Envelope:
    """Return the envelope of an event. Raises WireError if it is not an event, or has another wire version."""
    if not 2 <= len(frames) <= MOST_FRAMES:
        raise WireError(f"message: {len(frames)} frame(s); an event has 2 to {MOST_FRAMES}")
    header = from_json(frames[1], _envelope, LARGEST_FRAME)
    if header.v != WIRE:
        raise WireError(
            f"message: it has wire version {header.v}; this program reads version {WIRE}; upgrade the older side"
        )
    return header


def seq_of(frames: Sequence[bytes]) -> int | None:
    """Return the `seq` of an event whose header cannot be read as a whole, or None if it is no event."""
    found = _SEQ.match(frames[1]) if len(frames) > 1 else None
    return int(found[1]) if found else None


def decode(frames: Sequence[bytes]) -> ReceivedEvent:
    """Return the event. Raises WireError if the frames are not a valid event, whatever they contain."""
    header = envelope(frames)
    if header.kind not in Envelope.KINDS:
        raise WireError(f"message: kind {header.kind!r}; known are {', '.join(sorted(Envelope.KINDS))}")
    event = from_json(frames[1], _event, LARGEST_FRAME)
    if not (event.run and event.time) or event.seq < 0:
        raise WireError("message: the header lacks run or time, or its seq is negative")
    return ReceivedEvent(event, unpack(event.columns, frames[2:]))
