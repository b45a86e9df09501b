"""State files: the settings written as the commands that restore them, one per line, without the bias."""

from collections.abc import Iterator

from ..instrument.settings import KEPT, PER_ITEM, PER_TRACE, TABLE
from ..instrument.state import State
from .messages import CommandError, parse

_ORDERED = ("SWPP", "SWPT", "TRAC", "POWMOD", "DCO")
"""Settings that others depend on, first; DCO is left out, so that no file ever switches a bias on."""


def snapshot(state: State) -> bytes:
    """Return the settings as a state file."""
    return "".join(line + "\n" for line in _lines(state)).encode("latin-1")


def _lines(state: State) -> Iterator[str]:
    if state.table.segments:
        yield "EDITLIST"
        for s in state.table.segments:
            yield (
                f"SADD;STAR {s.start};STOP {s.stop};POIN {s.points};BWFACT {s.bandwidth};POWE {s.level};DCV {s.bias};"
                f"PAVERFACT {s.point_average};SDON"
            )
        yield "EDITDONE"
    for parameter, (start, stop) in state.edges.items():
        swept, _, ampere = parameter.partition(":")
        mode = {"OLEV": "POWMOD", "DCB": "DCMOD"}.get(swept)
        unit = f"{mode} {'CURR' if ampere else 'VOLT'};" if mode else ""
        yield f"{unit}SWPP {swept};STAR {start};STOP {stop}"
    yield f"SWPP {state['SWPP']};SWPT {state['SWPT']}"
    for mode, level in state.levels.items():
        yield f"POWMOD {mode};POWE {level}"
    yield f"POWMOD {state['POWMOD']}"
    for trace in "AB":
        yield f"TRAC {trace};" + ";".join(
            f"{name} {TABLE[name].answer(state.values[f'{name}:{trace}'])}" for name in sorted(PER_TRACE)
        )
    yield f"TRAC {state['TRAC']}"
    for name, setting in TABLE.items():
        if name not in PER_TRACE | PER_ITEM | KEPT and name not in _ORDERED:
            yield f"{name} {setting.answer(state[name])}"


def recall(state: State, content: bytes) -> None:
    """Restore a state file's settings and set all others to their defaults. Raises CommandError for any other file."""
    trial = State()
    for line in content.splitlines():
        for unit in parse(line):
            _apply(trial, unit.mnemonic, unit.arguments)
    state.__dict__.update(vars(trial))


def _apply(state: State, mnemonic: str, arguments: tuple[bytes, ...]) -> None:
    if mnemonic == "EDITLIST":
        state.table.start()
    elif mnemonic == "SADD":
        state.table.add(state.first_segment())
    elif mnemonic == "SDON":
        state.table.finish()
    elif mnemonic == "EDITDONE":
        state.table.done(in_use=False)
    elif len(arguments) == 1 and state.knows(mnemonic) and mnemonic != "DCO":
        state.set(mnemonic, arguments[0])
    else:
        raise CommandError(111)
