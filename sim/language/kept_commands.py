"""Commands that only store a value or do not affect measured data; the command reference says which."""

from collections.abc import Mapping

from ..instrument.instrument import Instrument
from ..instrument.settings import Number, Switch, whole
from .command_entry import Act, Ask, Entry
from .command_table import ROWS, Row
from .conditions import check
from .formats import printed
from .messages import CommandError, Unit, unquote

LIGHT_M_PER_S = 2.998e8
"""Between PORTL and PORTZ (PM p.402)."""


def _exclusive(row: Row) -> Entry:
    def act(instrument: Instrument, _: Unit) -> None:
        check(instrument, row.mnemonic)
        instrument.state.radios |= {name: name == row.mnemonic for name in row.rest.split("|")}

    return Entry(act)


def _is_chosen(name: str) -> Entry:
    return Entry(lambda i, _: "1" if i.state.radios[name] else "0")


def _reads(row: Row) -> Entry:
    def ask(instrument: Instrument, _: Unit) -> str:
        check(instrument, row.mnemonic)
        return row.rest

    return Entry(ask)


def _set_date(instrument: Instrument, unit: Unit) -> None:
    year, month, day = (whole(a, 0, 9999) for a in unit.arguments)
    try:
        wished = instrument.date().replace(year=year, month=month, day=day)
    except ValueError:
        raise CommandError(154) from None
    if not 1900 <= year <= 2099:
        raise CommandError(154)
    instrument.clock_offset += wished - instrument.date()


def _set_time(instrument: Instrument, unit: Unit) -> None:
    hour, minute, second = (whole(a, 0, high) for a, high in zip(unit.arguments, (23, 59, 59), strict=True))
    now = instrument.date()
    instrument.clock_offset += now.replace(hour=hour, minute=minute, second=second) - now


def _extension(instrument: Instrument, name: str, argument: bytes) -> None:
    metres = Number(-10 * LIGHT_M_PER_S, 10 * LIGHT_M_PER_S, 0.0, "M", 1e-6)
    seconds = Number(-10.0, 10.0, 0.0, "S", 1e-12)
    value = metres.parse(argument) / LIGHT_M_PER_S if name == "PORTL" else seconds.parse(argument)
    instrument.numbers["PORTZ"] = value


def _switch_extension(instrument: Instrument, unit: Unit) -> None:
    on = Switch(False).parse(unit.arguments[0])
    if on and instrument.state["E4TP"] not in ("APC7", "PROBE"):
        raise CommandError(12)
    instrument.numbers["PORE"] = float(on)


def _program(names: str) -> Act:
    """Commands of the built-in BASIC: the simulator has none and only stores the program."""

    def act(instrument: Instrument, unit: Unit) -> None:
        instrument.program[names] = b",".join(unit.arguments)
        if names.endswith("NAME"):
            unquote(unit.arguments[-1])

    return act


def _of_program(names: str, first: str) -> Ask:
    return lambda instrument, _: instrument.program.get(names, first.encode())


def _program_entries() -> tuple[dict[str, Entry], dict[str, Entry]]:
    commands: dict[str, Entry] = {}
    queries: dict[str, Entry] = {}
    first = {"NAME": '"PROG"', "STAT": "STOP", "WAIT": "1", "CAT": '""'}
    for row in ROWS.values():
        if not row.mnemonic.startswith(":PROG"):
            continue
        last = short_tree(row.mnemonic)
        if row.query != "only":
            commands[last] = Entry(_program(last), 1 if last.endswith("NAME") else 0, 255)
        if row.query != "none":
            queries[last] = Entry(_of_program(last, first.get(last.rsplit(":", 1)[-1], "")), 0, 2)
    return commands, queries


def short_tree(path: str) -> str:
    """Return a mnemonic of the PROGram tree in its short form, without optional levels: `PROG:DEF`."""
    levels = [level.split(" ")[0] for level in path.upper().strip(":").split(":")]
    kept = [level.strip("[]") for level in levels if not (level.startswith("[") and level.endswith("]"))]
    return ":".join(_SHORT.get(level.split("[")[0], level.split("[")[0]) for level in kept if level != "SELECTED")


_SHORT = {
    "PROGRAM": "PROG", "CATALOG": "CAT", "DEFINE": "DEF", "DELETE": "DEL", "EXECUTE": "EXEC", "EXPLICIT": "EXPL",
    "MALLOCATE": "MALL", "NUMBER": "NUMB", "STATE": "STAT", "STRING": "STR", "SELECTED": "SEL",
}  # fmt: skip

_PROGRAM_COMMANDS, _PROGRAM_QUERIES = _program_entries()

KEPT_COMMANDS: Mapping[str, Entry] = {
    **{row.mnemonic: Entry(lambda i, _: None) for row in ROWS.values() if row.kind == "action"},
    **{row.mnemonic: _exclusive(row) for row in ROWS.values() if row.kind == "radio"},
    "SETCDATE": Entry(_set_date, 3, 3),
    "SETCTIME": Entry(_set_time, 3, 3),
    "PORTL": Entry(lambda i, u: _extension(i, "PORTL", u.arguments[0]), 1, 1),
    "PORTZ": Entry(lambda i, u: _extension(i, "PORTZ", u.arguments[0]), 1, 1),
    "PORE": Entry(_switch_extension, 1, 1),
    **_PROGRAM_COMMANDS,
}
"""Commands by mnemonic."""

KEPT_QUERIES: Mapping[str, Entry] = {
    **{row.mnemonic: _is_chosen(row.mnemonic) for row in ROWS.values() if row.kind == "radio"},
    **{row.mnemonic: _reads(row) for row in ROWS.values() if row.kind == "reads"},
    "SETCDATE": Entry(lambda i, _: f"{i.date():%Y},{i.date().month},{i.date().day}"),
    "SETCTIME": Entry(lambda i, _: f"{i.date().hour},{i.date().minute},{i.date().second}"),
    "PORTL": Entry(lambda i, _: printed(i.numbers["PORTZ"] * LIGHT_M_PER_S)),
    "PORTZ": Entry(lambda i, _: printed(i.numbers["PORTZ"])),
    "PORE": Entry(lambda i, _: f"{i.numbers['PORE']:.0f}"),
    **_PROGRAM_QUERIES,
}
"""Queries by mnemonic, without the question mark."""
