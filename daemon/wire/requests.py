"""What can be asked of the daemon; `replies` is what it answers. The words are in docs/wire.md.

A request is a multipart message: one JSON header, then raw columns where it has any. The answer carries its `id`.
"""

from typing import Annotated, Any, TypeAlias

import msgspec

from ...models.build import Build
from ...models.sweep_plan import SweepPlan
from .events import WIRE
from .frames import ColumnHeader
from .result_messages import FitReport

MOST_EVENTS = 50
"""Events in one answer to `replay`."""

LONGEST_REASON = 1000
"""Characters of why a measurement is withdrawn."""

Id: TypeAlias = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]


class Request(msgspec.Struct, frozen=True, kw_only=True, tag_field="request"):
    """What all requests say. The same `id` asked again is answered again, and done once."""

    id: Id
    v: int = WIRE
    by: Annotated[str, msgspec.Meta(min_length=1, max_length=200)] | None = None
    """For whom a client asks that serves several people, as the live page does. The client says so, nobody checks."""


class HelloRequest(Request, frozen=True, kw_only=True, tag="hello"):
    """Ask who is there. A fitter gives its name and version, and is then listed as ready."""

    fitter: str | None = None
    version: str | None = None


class StatusRequest(Request, frozen=True, kw_only=True, tag="status"):
    """Ask what is going on."""


class MetricsRequest(Request, frozen=True, kw_only=True, tag="metrics"):
    """Ask what was counted and timed since the daemon began."""


class SettingsRequest(Request, frozen=True, kw_only=True, tag="settings"):
    """Ask how the daemon was started."""


class MeasureRequest(Request, frozen=True, kw_only=True, tag="measure"):
    """Measure this step of this build; answered as soon as it is accepted."""

    build: Build
    step: str
    plan: SweepPlan | None = None
    """The build's own plan where none is given."""
    priority: Annotated[int, msgspec.Meta(ge=-10, le=10)] = 0
    """Higher ones go first; what is being measured is finished."""
    lease: str | None = None
    """Needed while the instrument is leased."""
    decides: str | None = None
    """The measurement of this step whose diagnosis it is to decide: kept, but no record of the step, and not fitted."""


class LeaseRequest(Request, frozen=True, kw_only=True, tag="lease"):
    """Have the instrument to oneself for some seconds, or for longer; the daemon lets go of it meanwhile.

    Whoever holds the lease may talk to the instrument directly, or measure by requests that name it.
    """

    owner: Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
    """Who it is, for people."""
    seconds: Annotated[float, msgspec.Meta(gt=0, le=3600)]
    lease: str | None = None
    """The one that is held, to hold it for longer."""


class ReleaseRequest(Request, frozen=True, kw_only=True, tag="release"):
    """Give a lease back."""

    lease: str


class CancelRequest(Request, frozen=True, kw_only=True, tag="cancel"):
    """Cancel a measurement, queued or running; the running one where none is named."""

    measurement: str | None = None


class WithdrawRequest(Request, frozen=True, kw_only=True, tag="withdraw"):
    """Mark a complete measurement as withdrawn, in the name of `by`; for the daemon's own account alone."""

    measurement: str
    why: Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST_REASON)]


class ReplayRequest(Request, frozen=True, kw_only=True, tag="replay"):
    """The events `since` .. `until` (both included) once more; at most `max` in one answer."""

    since: Annotated[int, msgspec.Meta(ge=1)]
    until: int | None = None
    max: Annotated[int, msgspec.Meta(ge=1, le=MOST_EVENTS)] = MOST_EVENTS


class SamplesRequest(Request, frozen=True, kw_only=True, tag="samples"):
    """Ask which samples were measured, at which steps."""

    name: str | None = None
    """Only this one."""


class SweepsRequest(Request, frozen=True, kw_only=True, tag="sweeps"):
    """The sweeps of a measurement, after those of the latest measurement of each earlier step of the same sample."""

    measurement: str


class FitsRequest(Request, frozen=True, kw_only=True, tag="fits"):
    """What the fitters answered to a measurement."""

    measurement: str


class FitRequest(Request, frozen=True, kw_only=True, tag="fit"):
    """Fit a complete measurement with any installed fitter; answered as soon as it is accepted.

    What comes of it is a `fit` event, as from a fitter the daemon keeps.
    """

    measurement: str
    fitter: str


class DiagnoseRequest(Request, frozen=True, kw_only=True, tag="diagnose"):
    """Diagnose a complete measurement; answered as soon as it is accepted.

    What comes of it is a `diagnosis` event, or a `fit` event with the `error` that says why there is none.
    """

    measurement: str
    effects: tuple[str, ...] | None = None
    """Consider only these of the catalogue; all where none is given."""
    also: Annotated[tuple[Id, ...], msgspec.Meta(max_length=20)] = ()
    """Measurements that were made to decide it, whose sweeps count as further recordings of their step."""
    propose: bool = False
    """Whether to say which measurements would decide what stays open: `would_measure` in the diagnosis."""


class UnansweredRequest(Request, frozen=True, kw_only=True, tag="unanswered"):
    """The measurements of this run that this fitter has not answered yet."""

    fitter: str


class SubmitRequest(Request, frozen=True, kw_only=True, tag="submit"):
    """A fitter's answer: exactly one of `report`, `error`, `diagnosis`. Repeating it is harmless."""

    measurement: str
    fitter: str
    version: str
    sweeps: tuple[str, ...]
    report: FitReport | None = None
    error: str | None = None
    diagnosis: dict[str, Any] | None = None
    curves: tuple[str, ...] = ()
    columns: tuple[ColumnHeader, ...] = ()


class BenchRequest(Request, frozen=True, kw_only=True, tag="bench"):
    """A command for the simulator's virtual bench, passed on as it is."""

    command: dict[str, Any]


class ShutdownRequest(Request, frozen=True, kw_only=True, tag="shutdown"):
    """End: cancel what runs, bias off, let go of the instrument."""


AnyRequest: TypeAlias = (
    HelloRequest
    | StatusRequest
    | MetricsRequest
    | SettingsRequest
    | MeasureRequest
    | CancelRequest
    | WithdrawRequest
    | LeaseRequest
    | ReleaseRequest
    | ReplayRequest
    | SamplesRequest
    | SweepsRequest
    | FitsRequest
    | FitRequest
    | DiagnoseRequest
    | UnansweredRequest
    | SubmitRequest
    | BenchRequest
    | ShutdownRequest
)
