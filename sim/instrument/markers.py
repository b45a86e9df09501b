"""The markers of both traces: their positions and readings (PM p.96-105)."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from ...models.base.arrays import Reals
from ..language.messages import CommandError
from .search_range import searched
from .status import SEARCH_FAIL
from .trace_data import data_trace, memory_trace
from .trace_search import crossings, marker_peaks, sides

if TYPE_CHECKING:
    from .instrument import Instrument

SUBS = range(1, 8)


@dataclass
class Markers:
    """Marker, delta marker and sub markers of one trace. Positions are values of the sweep: Hz, V or A."""

    on: bool = False
    place: float = 0.0
    delta: str = "OFF"
    """DMKR."""
    delta_place: float = 0.0
    fixed: tuple[float, float] = (0.0, 0.0)
    """Values of the fixed delta marker."""
    subs: dict[int, float] = field(default_factory=dict[int, float])
    """Positions of the sub markers that are on."""
    width: bool = False
    """WIDT."""
    cut: int = 0
    """Number of the pair of cutoff points in use; the nearest is 0 (WIDSOUT, WIDSIN)."""
    search: str = "OFF"
    """SEAM."""
    monitor: str = "OFF"
    """MKRMON."""


@dataclass(frozen=True)
class Width:
    """Results of the bandwidth search; all 0 where it found nothing."""

    left: float = 0.0
    right: float = 0.0
    found: bool = False


def affected(instrument: "Instrument") -> Iterator[Markers]:
    """Yield the markers that a command moves: the active trace's, or both traces' where they are coupled."""
    active = str(instrument.state["TRAC"])
    yield instrument.markers[active]
    if instrument.state.on("MKRCOUP"):
        yield instrument.markers["B" if active == "A" else "A"]


def active(instrument: "Instrument") -> Markers:
    """Return the markers of the active trace."""
    return instrument.markers[str(instrument.state["TRAC"])]


def needed(instrument: "Instrument") -> Markers:
    """Return the markers of the active trace. Raises CommandError (98) where its marker is off."""
    markers = active(instrument)
    if not markers.on:
        raise CommandError(98)
    return markers


def on_trace(instrument: "Instrument") -> tuple[Reals, Reals, Reals]:
    """Return the positions and both values of the trace that the markers are on (MKRO)."""
    memory = instrument.state.of_trace("MKRO") == "MEMO" and instrument.memory is not None
    first, second = memory_trace(instrument) if memory else data_trace(instrument)
    return instrument.sweeper.axis.values, first, second


def values_at(instrument: "Instrument", place: float) -> tuple[float, float]:
    """Return both values of the trace at a position, interpolated between points where MKRMOV is CONT."""
    x, first, second = on_trace(instrument)
    if instrument.state.of_trace("MKRMOV") == "DISC" or np.any(np.diff(x) <= 0):
        k = nearest(x, place)
        return float(first[k]), float(second[k])
    return float(np.interp(place, x, first)), float(np.interp(place, x, second))


def nearest(x: Reals, place: float) -> int:
    """Return the number of the point nearest to a position, from 0."""
    return int(np.argmin(np.abs(x - place)))


def readout(instrument: "Instrument", place: float) -> tuple[float, float, float]:
    """Return value, second value and position, relative to the delta marker where one is on."""
    markers = active(instrument)
    first, second = values_at(instrument, place)
    if markers.delta == "OFF":
        return first, second, place
    reference = markers.fixed if markers.delta == "FIX" else values_at(instrument, markers.delta_place)
    return first - reference[0], second - reference[1], place - markers.delta_place


def move(instrument: "Instrument", place: float) -> None:
    """Move the marker to a position within the sweep."""
    x = instrument.sweeper.axis.values
    place = min(max(place, float(x.min())), float(x.max()))
    for markers in affected(instrument):
        discrete = instrument.state.of_trace("MKRMOV") == "DISC"
        markers.place = float(x[nearest(x, place)]) if discrete else place
        if markers.delta == "TRAC":
            markers.delta_place = markers.place


def switch_on(instrument: "Instrument") -> None:
    """Switch the marker on where it is off; it appears at the first point."""
    for markers in affected(instrument):
        if not markers.on:
            markers.on, markers.place = True, float(instrument.sweeper.axis.values.min())


def search(instrument: "Instrument", kind: str) -> bool:
    """Move the marker to what SEAM searches for; return whether it was found. Finding nothing is an event, no error."""
    switch_on(instrument)
    place = _found(instrument, kind)
    if place is None:
        _failed(instrument)
        return False
    move(instrument, place)
    return True


def _failed(instrument: "Instrument") -> None:
    instrument.status.raise_instrument(SEARCH_FAIL[str(instrument.state["TRAC"])])


def _range(instrument: "Instrument") -> tuple[Reals, Reals]:
    within = searched(instrument, str(instrument.state["TRAC"]))
    x, y, _ = on_trace(instrument)
    return x[within], y[within]


def _found(instrument: "Instrument", kind: str) -> float | None:
    x, y = _range(instrument)
    if not x.size:
        return None
    if kind in ("MAX", "MIN"):
        return float(x[np.argmax(y) if kind == "MAX" else np.argmin(y)])
    every = target_places(instrument) if kind == "TARG" else peak_places(instrument)
    return float(every[0]) if every.size else None


def target_places(instrument: "Instrument") -> Reals:
    """Return where the trace has the target value (relative to the delta marker), from left to right."""
    markers, target = active(instrument), float(instrument.state.of_trace("SEATARG"))
    if markers.delta != "OFF":
        target += markers.fixed[0] if markers.delta == "FIX" else values_at(instrument, markers.delta_place)[0]
    return crossings(*_range(instrument), target)


def peak_places(instrument: "Instrument") -> Reals:
    """Return where the peaks are, highest first (negative peaks: deepest first)."""
    state = instrument.state
    x, y = _range(instrument)
    dx = instrument.peak_dx[str(state["TRAC"])]
    peaks = marker_peaks(x, y, dx, float(state.of_trace("PKDLTY")), state.of_trace("PKPOL") == "NEG")
    return x[peaks]


def search_next(instrument: "Instrument", places: Reals, direction: str) -> None:
    """Move the marker to one of these positions: the nearest on the `left` or `right`, or the `next` in order."""
    here = needed(instrument).place
    if direction == "next":
        passed = np.flatnonzero(places == here)
        rest = places[passed[0] + 1 :] if passed.size else places
    else:
        rest = np.sort(places[places < here])[::-1] if direction == "left" else np.sort(places[places > here])
    if rest.size:
        move(instrument, float(rest[0]))
    else:
        _failed(instrument)


def width(instrument: "Instrument") -> Width:
    """Return the cutoff points of the bandwidth search around the marker, and move the sub markers 1 to 3 there."""
    markers, state = needed(instrument), instrument.state
    value, fixed = values_at(instrument, markers.place)[0], float(state.of_trace("WIDFVAL"))
    if markers.delta != "OFF":
        reference = markers.fixed[0] if markers.delta == "FIX" else values_at(instrument, markers.delta_place)[0]
        fixed = reference - fixed
    kinds = {"DIVS2": value / np.sqrt(2), "MULS2": value * np.sqrt(2), "DIV2": value / 2, "FIX": fixed}
    pairs = list(sides(*_range(instrument), markers.place, float(kinds[str(state.of_trace("WIDVTYPE"))])))
    if not pairs:
        _failed(instrument)
        return Width()
    left, right = pairs[min(markers.cut, len(pairs) - 1)]
    markers.subs |= {1: (left + right) / 2, 2: left, 3: right}
    return Width(left, right, True)
