"""The rows of an event: its own, and its changes of measurements and fits. All get entries in the chain."""

from collections.abc import Sequence

from ...wire.events import DiagnosisEvent, Event, FitEvent, Sampled, StateEvent
from ..store import Store
from .array_file import ArrayIndex, IndexedMeasurement
from .chain import chain_found, chain_row

WITHDRAWN = "withdrawn"
"""The state of a withdrawn measurement."""

Answer = FitEvent | DiagnosisEvent
"""The answer of a fitter to a measurement."""


def insert_event(store: Store, station: str, event: Event, frames: Sequence[bytes], digest: str | None) -> None:
    """Insert an event's rows; call it inside a transaction. `digest` is the hash of the event's array, if any."""
    measurement = event.measurement if isinstance(event, Sampled | StateEvent) else None
    row = (event.seq, kind_of(event), event.id, measurement, frames[0], frames[1], lengths_of(frames[2:]), digest)
    insert_event_row(store, station, row)
    if isinstance(event, StateEvent) and measurement:
        set_state(store, station, measurement, event.state)
    if isinstance(event, FitEvent | DiagnosisEvent):
        insert_answer(store, station, event)


def insert_event_row(store: Store, station: str, row: tuple[int | str | bytes | None, ...]) -> None:
    """Insert an event's own row: seq, kind, id, measurement, topic, header, lengths and hash."""
    store.run("INSERT INTO events VALUES (?, ?, ?, ?, ?, ?, ?, ?, ?)", *row, station)
    chain_row(store, station, "events", row)


def insert_answer(store: Store, station: str, event: Answer) -> None:
    """Insert a fitter's answer; a later answer of the same version to the same sweeps replaces it."""
    row = (*answer_key(event), event.measurement, int(succeeded(event)), event.seq)
    store.run(
        "INSERT INTO fits VALUES (?, ?, ?, ?, ?, ?, ?, ?) ON CONFLICT (kind, sweeps, fitter, version) DO UPDATE"
        " SET ok = excluded.ok, seq = excluded.seq, station = excluded.station",
        *(*row, station),
    )
    rows = store.all(
        "SELECT measurement FROM fits WHERE kind = ? AND sweeps = ? AND fitter = ? AND version = ?", *answer_key(event)
    )
    chain_row(store, station, "fits", (*answer_key(event), rows[0][0], int(succeeded(event)), event.seq))


def set_state(store: Store, station: str, measurement: str, state: str) -> None:
    """Update the state of a measurement."""
    store.run("UPDATE measurements SET state = ? WHERE id = ?", state, measurement)
    chain_found(store, station, "measurements", "id = ?", measurement)


def index_of(store: Store, station: str, event: Event, frames: Sequence[bytes], digest: str) -> ArrayIndex:
    """Return the index of an event's array."""
    runs = store.all("SELECT time FROM runs WHERE id = ?", event.run)
    measurement = event.measurement if isinstance(event, Sampled) else ""
    columns = "id, number, request, run, sample, step, build, time"
    rows = store.all(f"SELECT {columns} FROM measurements WHERE id = ?", measurement)  # noqa: S608
    return ArrayIndex(
        station=station,
        run=event.run,
        run_time=runs[0][0] if runs else event.time,
        seq=event.seq,
        kind=kind_of(event),
        id=event.id,
        topic=frames[0].decode(),
        header=frames[1].decode(),
        lengths=lengths_of(frames[2:]),
        hash=digest,
        measurement=IndexedMeasurement(**dict(zip(columns.split(", "), rows[0], strict=True))) if rows else None,
    )


def kind_of(event: Event) -> str:
    """Return the name of an event's kind."""
    return str(event.__struct_config__.tag)


def lengths_of(columns: Sequence[bytes]) -> str:
    """Return the bytes of each column, separated by commas."""
    return ",".join(str(len(column)) for column in columns)


def answer_key(event: Answer) -> tuple[str, str, str, str]:
    """Return the key of a fitter's answer: kind, sweeps, fitter, version."""
    return (kind_of(event), " ".join(event.sweeps), event.fitter, event.version)


def succeeded(event: Answer) -> bool:
    """Return whether an answer is a result and not a refusal."""
    return not (isinstance(event, FitEvent) and event.report is None)
