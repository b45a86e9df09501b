"""The requests to the daemon, as specified in docs/wire.md; `replies` holds the answers.

A request is a multipart message: one JSON header, then raw columns if there are any. The answer has the same `id`.
"""

from typing import Annotated, Any, TypeAlias

import msgspec

from ...models.build import Build
from ...models.sweep_plan import SweepPlan
from .events import WIRE
from .frames import ColumnHeader
from .result_messages import FitReport

MOST_EVENTS = 50
"""Greatest number of events in one answer to `replay`."""

LAST_SEQ = 2**63 - 1
"""Greatest `seq` that a database can hold."""

LONGEST_REASON = 1000
"""Greatest number of characters of the reason for withdrawing a measurement."""

LONGEST_ERROR = 4000
"""Greatest number of characters of a fitter's reason for giving no result."""

Id: TypeAlias = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]


class Request(msgspec.Struct, frozen=True, kw_only=True, tag_field="request"):
    """The fields of all requests. One repeated with the same `id` is answered again, but carried out only once."""

    id: Id
    v: int = WIRE
    by: Annotated[str, msgspec.Meta(min_length=1, max_length=200)] | None = None
    """The user for whom a client with several users asks, such as the live page. It is not checked."""


class HelloRequest(Request, frozen=True, kw_only=True, tag="hello"):
    """Ask for the daemon's version, instrument and endpoints. A fitter gives its name and version to be listed."""

    fitter: str | None = None
    version: str | None = None


class StatusRequest(Request, frozen=True, kw_only=True, tag="status"):
    """Ask for the current measurement, the queue and the fitters."""


class MetricsRequest(Request, frozen=True, kw_only=True, tag="metrics"):
    """Ask for counters since the daemon started, and latest durations."""


class SettingsRequest(Request, frozen=True, kw_only=True, tag="settings"):
    """Ask for the settings that the daemon was started with."""


class MeasureRequest(Request, frozen=True, kw_only=True, tag="measure"):
    """Measure this step of this build; answered as soon as it is accepted."""

    build: Build
    step: str
    plan: SweepPlan | None = None
    """None: the build's own plan."""
    priority: Annotated[int, msgspec.Meta(ge=-10, le=10)] = 0
    """Higher ones go first; a running measurement is not interrupted."""
    lease: str | None = None
    """Needed while the instrument is leased."""
    decides: str | None = None
    """The measurement of this step whose diagnosis this one helps to decide. Such a measurement is kept, but does not
    count as the step's own and is not fitted."""
    analyzer: Id | None = None
    """Name of the analyzer; None: the first one that this client may use."""


class LeaseRequest(Request, frozen=True, kw_only=True, tag="lease"):
    """Lease the instrument for exclusive use, or extend a lease; the daemon closes its connection meanwhile.

    The holder of the lease may use the instrument directly, or measure by requests that name the lease.
    """

    owner: Annotated[str, msgspec.Meta(min_length=1, max_length=200)]
    """Name of the owner, for people."""
    seconds: Annotated[float, msgspec.Meta(gt=0, le=3600)]
    lease: str | None = None
    """Id of the current lease, to extend it."""
    analyzer: Id | None = None
    """Name of the analyzer; None: that of the lease to extend, or the first one that this client may use."""


class ReleaseRequest(Request, frozen=True, kw_only=True, tag="release"):
    """Return a lease."""

    lease: str


class CancelRequest(Request, frozen=True, kw_only=True, tag="cancel"):
    """Cancel a queued or running measurement; by default the running one."""

    measurement: str | None = None
    analyzer: Id | None = None
    """The analyzer whose running measurement is meant; None: the first one that this client may use."""


class WithdrawRequest(Request, frozen=True, kw_only=True, tag="withdraw"):
    """Mark a complete measurement as withdrawn, in the name of `by`; only the daemon's own account may do so."""

    measurement: str
    why: Annotated[str, msgspec.Meta(min_length=1, max_length=LONGEST_REASON)]


class ReplayRequest(Request, frozen=True, kw_only=True, tag="replay"):
    """Ask for the events `since` .. `until` (both included) again, at most `max` in one answer."""

    since: Annotated[int, msgspec.Meta(ge=1, le=LAST_SEQ)]
    until: Annotated[int, msgspec.Meta(ge=0, le=LAST_SEQ)] | None = None
    max: Annotated[int, msgspec.Meta(ge=1, le=MOST_EVENTS)] = MOST_EVENTS


class SamplesRequest(Request, frozen=True, kw_only=True, tag="samples"):
    """Ask for the measurements of all samples."""

    name: str | None = None
    """Only this sample."""


class SweepsRequest(Request, frozen=True, kw_only=True, tag="sweeps"):
    """Ask for the sweeps of the latest measurement of each earlier step of a sample, then those of this measurement."""

    measurement: str


class FitsRequest(Request, frozen=True, kw_only=True, tag="fits"):
    """Ask for the fits and diagnoses of a measurement."""

    measurement: str


class FitRequest(Request, frozen=True, kw_only=True, tag="fit"):
    """Fit a complete measurement with any installed fitter; answered as soon as it is accepted.

    The result is a `fit` event, as from a fitter that the daemon keeps running.
    """

    measurement: str
    fitter: str


class DiagnoseRequest(Request, frozen=True, kw_only=True, tag="diagnose"):
    """Diagnose a complete measurement; answered as soon as it is accepted.

    The result is a `diagnosis` event, or a `fit` event whose `error` says why there is none.
    """

    measurement: str
    effects: tuple[str, ...] | None = None
    """Consider only these effects of the catalogue; None: all."""
    also: Annotated[tuple[Id, ...], msgspec.Meta(max_length=20)] = ()
    """Further measurements made to decide it, whose sweeps are used as further recordings of the step."""
    propose: bool = False
    """Whether to propose measurements that would decide what is open: `would_measure` in the diagnosis."""


class UnansweredRequest(Request, frozen=True, kw_only=True, tag="unanswered"):
    """Ask for the measurements of this run that this fitter has not answered yet."""

    fitter: str


class SubmitRequest(Request, frozen=True, kw_only=True, tag="submit"):
    """A fitter's answer: exactly one of `report`, `error`, `diagnosis`. Repeating it is harmless."""

    measurement: str
    fitter: str
    version: str
    sweeps: tuple[str, ...]
    report: FitReport | None = None
    error: Annotated[str, msgspec.Meta(max_length=LONGEST_ERROR)] | None = None
    diagnosis: dict[str, Any] | None = None
    curves: tuple[str, ...] = ()
    columns: tuple[ColumnHeader, ...] = ()


class BenchRequest(Request, frozen=True, kw_only=True, tag="bench"):
    """A command for the simulator's bench, passed on unchanged."""

    command: dict[str, Any]
    analyzer: Id | None = None
    """The analyzer whose bench is meant; None: the first one that this client may use."""


class ShutdownRequest(Request, frozen=True, kw_only=True, tag="shutdown"):
    """Stop the daemon: cancel the running measurement, turn the bias off, release the instrument."""


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
