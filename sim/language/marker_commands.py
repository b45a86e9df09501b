"""Markers, search, bandwidth and statistics (PM p.96-105, 302-306, 350-361, 426-441, 460)."""

from collections.abc import Callable, Mapping

import numpy as np

from ..instrument import display_scale, markers
from ..instrument.axis import limits
from ..instrument.instrument import PEAK_DX, Instrument
from ..instrument.markers import Markers, active, affected, needed, on_trace, readout
from ..instrument.search_range import searched
from ..instrument.settings import Choice, Number, Switch, number, whole
from .command_entry import Act, Ask, Entry
from .formats import printed, seven_digits
from .messages import CommandError, Unit

DELTA = Choice(("ON", "FIX", "TRAC", "OFF"), "OFF")
SEARCHES = Choice(("MAX", "MIN", "TARG", "PEAK", "OFF"), "OFF")
MONITORS = Choice(("OFF", "ACV", "ACI", "DCV", "DCI"), "OFF")
VALUE = Number(-100e6, 100e6, 0.0, "ANY")


def _points(instrument: Instrument) -> int:
    return instrument.sweeper.axis.values.size


def _place(instrument: Instrument, argument: bytes) -> float:
    """Return a value of the sweep, within it. Raises CommandError."""
    unit = limits("STAR", instrument.state.swept, "LIN").unit
    x = instrument.sweeper.axis.values
    return min(max(number(argument, unit), float(x.min())), float(x.max()))


def _of_point(instrument: Instrument, argument: bytes) -> float:
    return float(instrument.sweeper.axis.values[whole(argument, 1, _points(instrument)) - 1])


def _point_of(instrument: Instrument, place: float) -> str:
    return str(markers.nearest(instrument.sweeper.axis.values, place) + 1)


def _list(numbers: tuple[float, ...]) -> str:
    return ",".join(map(printed, seven_digits(np.array(numbers[:-1])).tolist())) + "," + printed(numbers[-1])


# the marker itself ---------------------------------------------------------------------------------------------------


def _switch(instrument: Instrument, unit: Unit) -> None:
    if Switch(False).parse(unit.arguments[0]):
        markers.switch_on(instrument)
    else:
        for one in affected(instrument):
            one.__dict__.update(vars(Markers()))


def _moved(place: Callable[[Instrument, bytes], float]) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        wished = place(instrument, unit.arguments[0])
        if not active(instrument).on and unit.mnemonic in ("MKRP", "MKRPRM"):
            raise CommandError(98)
        markers.move(instrument, wished)

    return act


def _moved_relative(instrument: Instrument, argument: bytes) -> float:
    marker = active(instrument)
    unit = limits("STAR", instrument.state.swept, "LIN").unit
    return _place(instrument, argument) if marker.delta == "OFF" else number(argument, unit) + marker.delta_place


def _read_marker(instrument: Instrument, _: Unit) -> str:
    return _list(readout(instrument, needed(instrument).place))


def _set_monitor(instrument: Instrument, unit: Unit) -> None:
    shown = MONITORS.parse(unit.arguments[0])
    if shown in ("DCV", "DCI") and instrument.state["BMON"] != {"DCV": "VOLT", "DCI": "CURR"}[shown]:
        raise CommandError(139)
    if shown in ("ACV", "ACI") and not instrument.state.on("OMON"):
        raise CommandError(140)
    active(instrument).monitor = shown


# the delta marker ----------------------------------------------------------------------------------------------------


def _delta(instrument: Instrument) -> Markers:
    if active(instrument).delta == "OFF":
        raise CommandError(99)
    return active(instrument)


def _fixed(instrument: Instrument) -> Markers:
    if _delta(instrument).delta != "FIX":
        raise CommandError(100)
    return active(instrument)


def _set_delta(instrument: Instrument, unit: Unit) -> None:
    kind = DELTA.parse(unit.arguments[0])
    if kind != "OFF":
        needed(instrument)
    value = markers.values_at(instrument, active(instrument).place)
    for one in affected(instrument):
        one.delta, one.delta_place, one.fixed = kind, one.place, value


def _move_delta(place: Callable[[Instrument, bytes], float]) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        _delta(instrument).delta_place = place(instrument, unit.arguments[0])

    return act


def _set_fixed(which: int) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        if which and instrument.state["MEAS"] != "COMP":
            raise CommandError(84)
        marker, value = _fixed(instrument), VALUE.parse(unit.arguments[0])
        marker.fixed = (marker.fixed[0], value) if which else (value, marker.fixed[1])

    return act


def _fixed_value(which: int) -> Ask:
    return lambda instrument, _: printed(active(instrument).fixed[which])


def _read_delta(instrument: Instrument, _: Unit) -> str:
    marker = _delta(instrument)
    values = marker.fixed if marker.delta == "FIX" else markers.values_at(instrument, marker.delta_place)
    return _list((*values, marker.delta_place))


# sub markers ---------------------------------------------------------------------------------------------------------


def _sub(instrument: Instrument, k: int) -> float:
    places = active(instrument).subs
    if k not in places:
        raise CommandError(98)
    return places[k]


def _switch_sub(k: int) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        on, place = Switch(False).parse(unit.arguments[0]), needed(instrument).place
        for one in affected(instrument):
            if on:
                one.subs[k] = place
            else:
                one.subs.pop(k, None)

    return act


def _move_sub(k: int, place: Callable[[Instrument, bytes], float]) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        _sub(instrument, k)
        for one in affected(instrument):
            one.subs[k] = place(instrument, unit.arguments[0])

    return act


def _sub_value(k: int, which: int) -> Ask:
    return lambda instrument, _: printed(readout(instrument, active(instrument).subs.get(k, 0.0))[which])


def _read_sub(k: int) -> Ask:
    return lambda instrument, _: _list(readout(instrument, _sub(instrument, k)))


# what the marker sets ------------------------------------------------------------------------------------------------


def _edge(mnemonic: str) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        instrument.set(mnemonic, repr(needed(instrument).place).encode("ascii"))

    return act


def _delta_span(instrument: Instrument, _: Unit) -> None:
    marker = _delta(instrument)
    instrument.set("SPAN", repr(abs(marker.place - marker.delta_place)).encode("ascii"))


def _zoom(instrument: Instrument, _: Unit) -> None:
    place, share = needed(instrument).place, instrument.state.real("ZMAPER") / 100
    x = instrument.sweeper.axis.values
    instrument.set("CENT", repr(place).encode("ascii"))
    instrument.set("SPAN", repr(share * float(np.ptp(x))).encode("ascii"))


def _peak_to_centre(instrument: Instrument, _: Unit) -> None:
    needed(instrument)
    if markers.search(instrument, "PEAK"):
        instrument.set("CENT", repr(active(instrument).place).encode("ascii"))


def _marker_value(instrument: Instrument) -> float:
    return markers.values_at(instrument, needed(instrument).place)[0]


def _keep_value(mnemonic: str) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        value = _marker_value(instrument)
        if mnemonic == "DATOVAL" and instrument.state["MEAS"] == "COMP":
            raise CommandError(83)
        instrument.state.values[f"{mnemonic}:{instrument.state['TRAC']}"] = value

    return act


def _peak_definition(instrument: Instrument, _: Unit) -> None:
    here = needed(instrument).place
    x, y, _second = on_trace(instrument)
    k = markers.nearest(x, here)
    other = k - 1 if active(instrument).delta == "OFF" else markers.nearest(x, active(instrument).delta_place)
    trace = str(instrument.state["TRAC"])
    instrument.peak_dx[trace] = float(abs(x[k] - x[other]))
    instrument.state.values[f"PKDLTY:{trace}"] = float(abs(y[k] - y[other]))


def _manual_point(instrument: Instrument, _: Unit) -> None:
    x = instrument.sweeper.axis.values
    instrument.sweeper.manual_point = markers.nearest(x, needed(instrument).place) + 1


# search --------------------------------------------------------------------------------------------------------------


def _search(instrument: Instrument, unit: Unit) -> None:
    kind = SEARCHES.parse(unit.arguments[0])
    active(instrument).search = kind
    if kind != "OFF":
        markers.search(instrument, kind)


def _next(places: Callable[[Instrument], markers.Reals], direction: str) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        needed(instrument)
        markers.search_next(instrument, places(instrument), direction)

    return act


def _border_kind(instrument: Instrument, name: str) -> Number:
    kind = limits("STAR", instrument.state.swept, "LIN")
    return Number(kind.low, kind.high, kind.low if name == "SEARMIN" else kind.high, kind.unit, kind.step)


def _border(name: str, place: Callable[[Instrument, bytes], float]) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        _no_list(instrument)
        instrument.borders[str(instrument.state["TRAC"])].search[name] = place(instrument, unit.arguments[0])

    return act


def _no_list(instrument: Instrument) -> None:
    if instrument.state["SWPT"] == "LIST":
        raise CommandError(133)


def _border_value(instrument: Instrument, name: str) -> float:
    value = instrument.borders[str(instrument.state["TRAC"])].search[name]
    return _border_kind(instrument, name).default if value is None else value


def _border_from_marker(*names: str) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        marker = needed(instrument)
        places = [marker.place]
        if len(names) == 2:
            places = sorted((marker.place, _delta(instrument).delta_place))
        instrument.borders[str(instrument.state["TRAC"])].search.update(zip(names, places, strict=True))

    return act


def _set_peak_dx(instrument: Instrument, unit: Unit) -> None:
    swept = instrument.state.swept
    kind = limits("STAR", swept, "LIN")
    most = kind.high - min(kind.low, 0.0)
    instrument.peak_dx[str(instrument.state["TRAC"])] = Number(0.0, most, PEAK_DX[swept], kind.unit).parse(
        unit.arguments[0]
    )


def _choose_segment(instrument: Instrument, unit: Unit) -> None:
    if instrument.state["SWPT"] != "LIST":
        raise CommandError(132)
    if instrument.state.of_trace("SEARNG") != "SEGMENT":
        raise CommandError(102)
    most = len(instrument.state.table.segments)
    instrument.borders[str(instrument.state["TRAC"])].segment = whole(unit.arguments[0], 1, most)


# width and statistics ------------------------------------------------------------------------------------------------


def _switch_width(instrument: Instrument, unit: Unit) -> None:
    on = Switch(False).parse(unit.arguments[0])
    marker = needed(instrument)
    marker.width, marker.cut = on, 0
    if on:
        markers.width(instrument)


def _other_cutoff(step: int) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        marker = active(instrument)
        if not marker.width:
            raise CommandError(101)
        marker.cut = max(marker.cut + step, 0)
        markers.width(instrument)

    return act


def _read_width(instrument: Instrument, _: Unit) -> str:
    marker = active(instrument)
    if not marker.width:
        return ",".join([printed(0.0)] * 6)
    found, value = markers.width(instrument), _marker_value(instrument)
    if not found.found:
        return ",".join(map(printed, (0.0, 0.0, 0.0, value, 0.0, 0.0)))
    x = instrument.sweeper.axis.values
    middle, span = (found.left + found.right) / 2, found.right - found.left
    shift = (float(x[0]) + float(x[-1])) / 2 + (marker.delta_place if marker.delta == "FIX" else 0.0)
    return ",".join(map(printed, (span, middle, middle / span, value, found.left - shift, found.right - shift)))


def _statistics(instrument: Instrument, _: Unit) -> str:
    y = on_trace(instrument)[1][searched(instrument, str(instrument.state["TRAC"]))]
    spread = float(y.std(ddof=1)) if y.size > 1 else 0.0
    return ",".join(map(printed, seven_digits(np.array([y.mean(), spread, np.ptp(y)])).tolist()))


def _scale_reference(instrument: Instrument, _: Unit) -> None:
    display_scale.put(instrument, "REFV", repr(_marker_value(instrument)).encode("ascii"))


MARKER_COMMANDS: Mapping[str, Entry] = {
    "MKR": Entry(_switch, 1, 1),
    "MKRP": Entry(_moved(_of_point), 1, 1),
    "MKRPRM": Entry(_moved(_moved_relative), 1, 1),
    "MKRMON": Entry(_set_monitor, 1, 1),
    "DMKR": Entry(_set_delta, 1, 1),
    "DMKRP": Entry(_move_delta(_of_point), 1, 1),
    "DMKRPRM": Entry(_move_delta(_place), 1, 1),
    "DMKRVAL": Entry(_set_fixed(0), 1, 1),
    "DMKRAUV": Entry(_set_fixed(1), 1, 1),
    **{f"SMKR{k}": Entry(_switch_sub(k), 1, 1) for k in markers.SUBS},
    **{f"SMKRP{k}": Entry(_move_sub(k, _of_point), 1, 1) for k in markers.SUBS},
    **{f"SMKRPRM{k}": Entry(_move_sub(k, _moved_relative), 1, 1) for k in markers.SUBS},
    "MKRSTAR": Entry(_edge("STAR")),
    "MKRSTOP": Entry(_edge("STOP")),
    "MKRCENT": Entry(_edge("CENT")),
    "MKRDSPAN": Entry(_delta_span),
    "MKRZM": Entry(_zoom),
    "PEAKCENT": Entry(_peak_to_centre),
    "MKRREF": Entry(_scale_reference),
    "MKROFS": Entry(_keep_value("DATOVAL")),
    "MKRAMPO": Entry(_keep_value("LIMIAMPO")),
    "MKRPKD": Entry(_peak_definition),
    "MKRMANP": Entry(_manual_point),
    "SEAM": Entry(_search, 1, 1),
    "SEANPK": Entry(_next(markers.peak_places, "next")),
    "SEANPKL": Entry(_next(markers.peak_places, "left")),
    "SEANPKR": Entry(_next(markers.peak_places, "right")),
    "SEAL": Entry(_next(markers.target_places, "left")),
    "SEAR": Entry(_next(markers.target_places, "right")),
    "SEARMIN": Entry(_border("SEARMIN", _place), 1, 1),
    "SEARMAX": Entry(_border("SEARMAX", _place), 1, 1),
    "SEARMINP": Entry(_border("SEARMIN", _of_point), 1, 1),
    "SEARMAXP": Entry(_border("SEARMAX", _of_point), 1, 1),
    "MKRTR": Entry(_border_from_marker("SEARMIN", "SEARMAX")),
    "MKRTRMIN": Entry(_border_from_marker("SEARMIN")),
    "MKRTRMAX": Entry(_border_from_marker("SEARMAX")),
    "PKDLTX": Entry(_set_peak_dx, 1, 1),
    "SEGMNUM": Entry(_choose_segment, 1, 1),
    "WIDT": Entry(_switch_width, 1, 1),
    "WIDSOUT": Entry(_other_cutoff(1)),
    "WIDSIN": Entry(_other_cutoff(-1)),
}
"""Commands by mnemonic."""


def _segment_number(instrument: Instrument, _: Unit) -> str:
    return str(instrument.borders[str(instrument.state["TRAC"])].segment)


MARKER_QUERIES: Mapping[str, Entry] = {
    "MKR": Entry(lambda i, _: "1" if active(i).on else "0"),
    "MKRP": Entry(lambda i, _: _point_of(i, active(i).place)),
    "MKRPRM": Entry(lambda i, _: printed(readout(i, active(i).place)[2])),
    "MKRVAL": Entry(lambda i, _: printed(readout(i, needed(i).place)[0])),
    "MKRAUV": Entry(lambda i, _: printed(readout(i, needed(i).place)[1])),
    "MKRMON": Entry(lambda i, _: active(i).monitor),
    "OUTPMKR": Entry(_read_marker),
    "DMKR": Entry(lambda i, _: active(i).delta),
    "DMKRP": Entry(lambda i, _: _point_of(i, active(i).delta_place)),
    "DMKRPRM": Entry(lambda i, _: printed(active(i).delta_place)),
    "DMKRVAL": Entry(_fixed_value(0)),
    "DMKRAUV": Entry(_fixed_value(1)),
    "OUTPDMKR": Entry(_read_delta),
    **{f"SMKR{k}": Entry(lambda i, _, k=k: "1" if k in active(i).subs else "0") for k in markers.SUBS},
    **{f"SMKRP{k}": Entry(lambda i, _, k=k: _point_of(i, active(i).subs.get(k, 0.0))) for k in markers.SUBS},
    **{f"SMKRPRM{k}": Entry(_sub_value(k, 2)) for k in markers.SUBS},
    **{f"SMKRVAL{k}": Entry(_sub_value(k, 0)) for k in markers.SUBS},
    **{f"SMKRAUV{k}": Entry(_sub_value(k, 1)) for k in markers.SUBS},
    **{f"OUTPSMKR{k}": Entry(_read_sub(k)) for k in markers.SUBS},
    "SEAM": Entry(lambda i, _: active(i).search),
    "SEARMIN": Entry(lambda i, _: printed(_border_value(i, "SEARMIN"))),
    "SEARMAX": Entry(lambda i, _: printed(_border_value(i, "SEARMAX"))),
    "SEARMINP": Entry(lambda i, _: _point_of(i, _border_value(i, "SEARMIN"))),
    "SEARMAXP": Entry(lambda i, _: _point_of(i, _border_value(i, "SEARMAX"))),
    "PKDLTX": Entry(lambda i, _: printed(i.peak_dx[str(i.state["TRAC"])])),
    "SEGMNUM": Entry(_segment_number),
    "WIDT": Entry(lambda i, _: "1" if active(i).width else "0"),
    "OUTPMWID": Entry(_read_width),
    "OUTPMSTA": Entry(_statistics),
}
"""Queries by mnemonic, without the question mark."""
