"""Limit lines: their table, and the results of the test (PM p.324-340, 353-354, 380-384)."""

from collections.abc import Callable, Mapping

import numpy as np

from ..instrument.axis import limits
from ..instrument.instrument import Instrument, limit_result
from ..instrument.limit_lines import FAILED, LimitSegment, LimitTable
from ..instrument.markers import nearest, needed, values_at
from ..instrument.settings import Number, Switch, number, whole
from .command_entry import Act, Ask, Entry
from .formats import encode, printed
from .messages import Unit

VALUE = Number(-1e9, 1e9, 0.0, "ANY")

Edge = tuple[float, float]
"""Upper and lower limit at one end of a segment."""


def _table(instrument: Instrument) -> LimitTable:
    return instrument.limits[str(instrument.state["TRAC"])]


def _first(instrument: Instrument) -> LimitSegment:
    return LimitSegment(*instrument.state.edges[instrument.state.swept])


def _number(unit: Unit) -> int | None:
    return round(number(unit.arguments[0])) if unit.arguments else None


def _ends(end: str) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        kind = limits("STAR", instrument.state.swept, "LIN")
        _table(instrument).change(_first(instrument), **{end: kind.parse(unit.arguments[0])})

    return act


_CHANGED: Mapping[str, Callable[[float, Edge], Edge]] = {
    "U": lambda value, edge: (value, edge[1]),
    "L": lambda value, edge: (edge[0], value),
    "V": lambda value, edge: (value + (edge[0] - edge[1]) / 2, value - (edge[0] - edge[1]) / 2),
    "D": lambda value, edge: ((edge[0] + edge[1]) / 2 + value, (edge[0] + edge[1]) / 2 - value),
}
"""Limits after upper, lower, centre or half width was set."""


def _set_limit(kind: str, end: str, value: Callable[[Instrument, Unit], float]) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        new, draft = value(instrument, unit), _table(instrument).draft(_first(instrument))
        before = vars(draft)
        upper, lower = _CHANGED[kind](new, (before[f"upper_{end}"], before[f"lower_{end}"]))
        _table(instrument).change(draft, **{f"upper_{end}": upper, f"lower_{end}": lower})

    return act


def _limit(kind: str, end: str) -> Ask:
    def ask(instrument: Instrument, _: Unit) -> str:
        draft = vars(_table(instrument).draft(_first(instrument)))
        upper, lower = draft[f"upper_{end}"], draft[f"lower_{end}"]
        return printed({"U": upper, "L": lower, "V": (upper + lower) / 2, "D": (upper - lower) / 2}[kind])

    return ask


def _sent(_: Instrument, unit: Unit) -> float:
    return VALUE.parse(unit.arguments[0])


def _at_marker(instrument: Instrument, _: Unit) -> float:
    return values_at(instrument, needed(instrument).place)[0]


def _end_from_marker(end: str) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        _table(instrument).change(_first(instrument), **{end: needed(instrument).place})

    return act


def _test_segment(instrument: Instrument, unit: Unit) -> None:
    _table(instrument).change(_first(instrument), tested=Switch(True).parse(unit.arguments[0]))


def _draft_of(instrument: Instrument) -> LimitSegment:
    return _table(instrument).draft(_first(instrument))


def _rows(instrument: Instrument) -> np.ndarray[tuple[int, int], np.dtype[np.float64]]:
    """Return sweep value, result, upper and lower limit of every point, shape (N, 4)."""
    result = limit_result(instrument, str(instrument.state["TRAC"]))
    return np.column_stack((instrument.sweeper.axis.values, result.result, result.upper, result.lower))


def _failed(instrument: Instrument, _: Unit) -> bytes:
    rows = _rows(instrument)
    failed = rows[rows[:, 1] == FAILED]
    return encode(failed.ravel() if failed.size else np.ones(1), instrument.state.form)


def _marked(instrument: Instrument, _: Unit) -> str:
    place = needed(instrument).place
    row = _rows(instrument)[nearest(instrument.sweeper.axis.values, place)]
    return ",".join(map(printed, row.tolist()))


_KINDS = [(kind, end) for kind in "ULVD" for end in ("start", "stop")]


def _mnemonic(kind: str, end: str) -> str:
    return f"LIM{kind}{'STAR' if end == 'start' else 'STOP'}"


LIMIT_COMMANDS: Mapping[str, Entry] = {
    "EDITLIML": Entry(lambda i, _: _table(i).start()),
    "LIMCLEL": Entry(lambda i, _: _table(i).clear()),
    "LIMSADD": Entry(lambda i, u: _table(i).add(_first(i), _number(u)), 0, 1),
    "LIMSEDI": Entry(lambda i, u: _table(i).open(_first(i), _number(u)), 0, 1),
    "LIMSDEL": Entry(lambda i, u: _table(i).delete(_number(u)), 0, 1),
    "LIMSEGM": Entry(lambda i, u: _table(i).choose(whole(u.arguments[0], 1, 99)), 1, 1),
    "LIMSDON": Entry(lambda i, _: _table(i).finish()),
    "LIMSQUI": Entry(lambda i, _: _table(i).abandon()),
    "LIMEDONE": Entry(lambda i, _: _table(i).done()),
    "LIMSTAR": Entry(_ends("start"), 1, 1),
    "LIMSTOP": Entry(_ends("stop"), 1, 1),
    "LIMSTEST": Entry(_test_segment, 1, 1),
    **{_mnemonic(kind, end): Entry(_set_limit(kind, end, _sent), 1, 1) for kind, end in _KINDS},
    "MKRLIMSTAR": Entry(_end_from_marker("start")),
    "MKRLIMSTOP": Entry(_end_from_marker("stop")),
    "MKRLIMVSTAR": Entry(_set_limit("V", "start", _at_marker)),
    "MKRLIMVSTOP": Entry(_set_limit("V", "stop", _at_marker)),
}
"""Commands by mnemonic."""

LIMIT_QUERIES: Mapping[str, Entry] = {
    "LIMSEGM": Entry(lambda i, _: str(_table(i).target)),
    "LIMSTAR": Entry(lambda i, _: printed(_draft_of(i).start)),
    "LIMSTOP": Entry(lambda i, _: printed(_draft_of(i).stop)),
    "LIMSTEST": Entry(lambda i, _: "1" if _draft_of(i).tested else "0"),
    **{_mnemonic(kind, end): Entry(_limit(kind, end)) for kind, end in _KINDS},
    "OUTPFAIP": Entry(lambda i, _: str(int((_rows(i)[:, 1] == FAILED).sum()))),
    "OUTPLIML": Entry(lambda i, _: encode(_rows(i).ravel(), i.state.form)),
    "OUTPLIMF": Entry(_failed),
    "OUTPLIMM": Entry(_marked),
}
"""Queries by mnemonic, without the question mark."""
