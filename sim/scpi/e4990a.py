"""The Keysight E4990A: the SCPI commands that public drivers use, on the same sweeps, bench and bridge.

Sources: rjollos/e4990a (Python, with pages of the manual), trcrenshaw/E4990A-ImpedanceAnalyzer, the E4990A classes of
magdynlab (Diego Gonzalez Chavez) and of a probe station (PySide), a pymeasure driver that quotes the help's syntax of
CALCulate, INITiate and TRIGger, and a MATLAB class. Features that none of them uses are in UNCONFIRMED.
"""

from collections.abc import AsyncIterator, Callable
from dataclasses import replace

import numpy as np

from ...models.base.arrays import Complexes, Impedances, Reals
from ..instrument.axis import Axis, ListSegment
from ..instrument.correction import STANDARDS, as_kept
from ..instrument.instrument import Instrument
from ..instrument.settings import Choice, Integer, Number, Setting, Switch, number
from ..instrument.status import OPC
from ..instrument.sweep_run import FOREVER
from ..instrument.traces import QUANTITIES, Parts
from ..language.command_entry import Act, Ask
from ..language.formats import block, pairs, seven_digits
from ..language.messages import CommandError, Unit, parse
from .tree import Node, Tree

IDENTITY = "Keysight Technologies,E4990A,{serial},A.03.03"

LOWEST_HZ, HIGHEST_HZ, POINTS = 20.0, 120e6, 1601

UNCONFIRMED = (
    "the six digits in the head of a block (as in the E5061B)",
    "SOURce<Ch>:CURRent and the oscillator's range in ampere",
    "STATus:OPERation:CONDition bit 5 (waiting for a trigger)",
    "CORRection2:LOAD and the array behind CORRection2:ZMEasurement:LOAD",
    'the texts of the error queue beyond `+0,"No error"`',
)
"""Features without a public source; they are simulated like those of the E5061B of the same generation."""

MEASURING, WAITING = 1 << 4, 1 << 5
"""Bits of the operation status condition."""

PARAMETERS = {
    "Z": "|Z|", "Y": "|Y|", "R": "R", "X": "X", "G": "G", "B": "B", "LS": "Ls", "LP": "Lp", "CS": "Cs", "CP": "Cp",
    "RS": "R", "RP": "Rp", "Q": "Q", "D": "D", "TZ": "theta_z", "TY": "theta_y", "IMP": "", "ADM": "",
}  # fmt: skip
"""Quantity of a trace by CALCulate:PARameter:DEFine; the last two are complex."""

FREQUENCY = Number(LOWEST_HZ, HIGHEST_HZ, LOWEST_HZ, "HZ", 1e-3)
STANDARD_NAMES = dict(zip(("OPEN", "SHORt", "LOAD"), STANDARDS, strict=True))


def set_initial(instrument: Instrument) -> None:
    """Set the defaults of this analyzer's `*RST`, which differ from the 4294A's."""
    state = instrument.state
    state.edges["FREQ"] = (LOWEST_HZ, 10e6)
    state.values |= {"BWFACT": 1, "PAVERFACT": 1}
    instrument.scpi = {
        "cont": False, "init": False, "source": "INT", "form": "ASC", "order": "NORM", "trace": 1, "avertrig": False,
        "type": "LIN", "fixture": "NONE", "points": "FIX", "PAR1": "Z", "PAR2": "TZ", "PAR3": "CP", "PAR4": "D",
    }  # fmt: skip
    instrument.new_axis()


# settings ------------------------------------------------------------------------------------------------------------


def _answer(setting: Setting, value: object) -> str:
    if isinstance(setting, Number):
        return f"{float(str(value)):+.11E}"
    return f"{value:+d}" if isinstance(setting, Integer) and isinstance(value, int) else setting.answer(str(value))


def _restart(instrument: Instrument, axis: bool) -> None:
    """Apply a setting; segments use speed, level and averaging of the sweep."""
    state = instrument.state
    state.table.segments = [
        replace(
            segment,
            bandwidth=state.count("BWFACT"),
            level=state.levels[str(state["POWMOD"])],
            point_average=state.count("PAVERFACT") if state.on("PAVER") else 1,
        )
        for segment in state.table.segments
    ]
    if axis:
        instrument.new_axis()
    instrument.sweeper.averaged = 0
    if instrument.sweeper.running is not None:
        _rearm(instrument)


def _value(header: str, setting: Setting, key: str, axis: bool = False) -> Node:
    """Return a setting that the 4294A also has, under its mnemonic."""

    def act(instrument: Instrument, unit: Unit) -> None:
        value = setting.parse(unit.arguments[0])
        if instrument.state.values[key] != value:
            instrument.state.values[key] = value
            _restart(instrument, axis)

    def ask(instrument: Instrument, _: Unit) -> str:
        value = instrument.state.values[key]
        return ("1" if value else "0") if isinstance(setting, Switch) else _answer(setting, value)

    return Node(header, act, ask, (1, 1))


def _own(header: str, setting: Setting, key: str, then: Callable[[Instrument], None] = lambda _: None) -> Node:
    """Return a setting that only this analyzer has."""

    def act(instrument: Instrument, unit: Unit) -> None:
        instrument.scpi[key] = setting.parse(_short_token(setting, unit.arguments[0]))
        then(instrument)

    def ask(instrument: Instrument, _: Unit) -> str:
        value = instrument.scpi[key]
        return ("1" if value else "0") if isinstance(setting, Switch) else str(value)

    return Node(header, act, ask, (1, 1))


def _short_token(setting: Setting, argument: bytes) -> bytes:
    """Return the short form of a token."""
    word = argument.upper()
    if isinstance(setting, Choice) and word.decode("latin-1") not in setting.tokens:
        return next((token.encode() for token in setting.tokens if word.startswith(token.encode())), word)
    return word


def _edge(which: int) -> Node:
    def act(instrument: Instrument, unit: Unit) -> None:
        edges = list(instrument.state.edges["FREQ"])
        edges[which] = FREQUENCY.parse(unit.arguments[0])
        edges[1 - which] = max(edges) if which == 0 else min(edges)
        if tuple(edges) != instrument.state.edges["FREQ"]:
            instrument.state.edges["FREQ"] = (edges[0], edges[1])
            _restart(instrument, True)

    def ask(instrument: Instrument, _: Unit) -> str:
        return _answer(FREQUENCY, instrument.state.edges["FREQ"][which])

    return Node(f"SENSe<Ch>:FREQuency:{'STARt' if which == 0 else 'STOP'}", act, ask, (1, 1))


def _level(mode: str, low: float, high: float) -> Node:
    kind = Number(low, high, low, mode[0].replace("C", "A"), 1e-3 if mode == "VOLT" else 1e-5)

    def act(instrument: Instrument, unit: Unit) -> None:
        instrument.state.levels[mode] = kind.parse(unit.arguments[0])
        _restart(instrument, False)

    def ask(instrument: Instrument, _: Unit) -> str:
        return _answer(kind, instrument.state.levels[mode])

    return Node(f"SOURce<Ch>:{'VOLTage' if mode == 'VOLT' else 'CURRent'}[:LEVel]", act, ask, (1, 1))


def _choose_type(instrument: Instrument) -> None:
    kind = str(instrument.scpi["type"])
    if kind == "SEGM" and not instrument.state.table.segments:
        instrument.scpi["type"] = "LIN"
        raise CommandError(124)
    instrument.state.values["SWPT"] = "LIST" if kind == "SEGM" else kind
    _restart(instrument, True)


def _set_segments(instrument: Instrument, unit: Unit) -> None:
    """SEGMent:DATA 7,<start/stop>,<6 switches>,<count>, then start, stop, points [, settings switched on] of each."""
    values = [number(a) for a in unit.arguments]
    if (
        instrument.no_list
        or len(values) < 12
        or values[0] != 7
        or any(values[1:8])
        or len(values) != 9 + 3 * int(values[8])
    ):
        raise CommandError(-220)
    rows = [values[k : k + 3] for k in range(9, len(values), 3)]
    if not all(LOWEST_HZ <= start <= stop <= HIGHEST_HZ and 2 <= count <= POINTS for start, stop, count in rows):
        raise CommandError(-222)
    instrument.state.table.segments = [
        ListSegment(start, stop, int(count), 1, 0.5, 0.0, 1) for start, stop, count in rows
    ]
    _restart(instrument, True)


def _segments(instrument: Instrument, _: Unit) -> str:
    table = instrument.state.table.segments
    rows = (f",{s.start:+.11E},{s.stop:+.11E},{s.points:d}" for s in table)
    return f"7,0,0,0,0,0,0,0,{len(table)}" + "".join(rows)


# the trigger system --------------------------------------------------------------------------------------------------


def _rearm(instrument: Instrument) -> None:
    """Continue to sweep with the internal trigger, otherwise wait for a trigger."""
    scpi = instrument.scpi
    instrument.sweeper.hold()
    if scpi["cont"] and scpi["source"] == "INT":
        instrument.sweeper.start(FOREVER)


def _initiate(instrument: Instrument, _: Unit) -> None:
    if instrument.scpi["cont"] or instrument.sweeper.seconds_left() > 0:
        raise CommandError(-213)
    instrument.scpi["init"] = True
    if instrument.scpi["source"] == "INT":
        _trigger_now(instrument)


def _trigger(instrument: Instrument, _: Unit) -> None:
    scpi = instrument.scpi
    if not (scpi["cont"] or scpi["init"]) or instrument.sweeper.seconds_left() > 0 or scpi["source"] == "INT":
        raise CommandError(-211)
    _trigger_now(instrument)


def _trigger_now(instrument: Instrument) -> None:
    instrument.scpi["init"] = False
    averaged = instrument.scpi["avertrig"] and instrument.state.on("AVER")
    instrument.sweeper.start(instrument.state.count("AVERFACT") if averaged else 1)


def _abort(instrument: Instrument, _: Unit) -> None:
    instrument.scpi["init"] = False
    _rearm(instrument)


def _condition(instrument: Instrument, _: Unit) -> str:
    measuring = instrument.sweeper.running is not None
    waiting = not measuring and bool(instrument.scpi["cont"] or instrument.scpi["init"])
    return f"+{MEASURING * measuring + WAITING * waiting}"


def _clear_average(instrument: Instrument, _: Unit) -> None:
    instrument.sweeper.averaged = 0


# data ----------------------------------------------------------------------------------------------------------------


def _encoded(instrument: Instrument, values: Reals) -> bytes:
    if instrument.scpi["form"] == "ASC":
        return ",".join(f"{v:+.11E}" for v in values).encode("ascii")
    kind = "f8" if instrument.scpi["form"] == "REAL" else "f4"
    return block(values.astype((">" if instrument.scpi["order"] == "NORM" else "<") + kind).tobytes())


def _formatted(instrument: Instrument, _: Unit) -> bytes:
    """FDATa: the selected trace after every correction, in pairs; the second number is 0 unless it is complex."""
    axis, z = instrument.sweeper.axis, instrument.sweeper.data
    shown = str(instrument.scpi[f"PAR{instrument.scpi['trace']}"])
    with np.errstate(all="ignore"):
        y: Complexes = np.asarray(np.where(z == 0, 0, 1 / np.where(z == 0, 1, z)), dtype=np.complex128)
        if shown in ("IMP", "ADM"):
            whole: Complexes = z if shown == "IMP" else y
            return _encoded(instrument, seven_digits(pairs(whole.real, whole.imag)))
        first = QUANTITIES[PARAMETERS[shown]](Parts(2 * np.pi * axis.frequency, z, y))
    first = seven_digits(np.nan_to_num(first))
    return _encoded(instrument, pairs(first, np.zeros_like(first)))


def _impedance(instrument: Instrument, _: Unit) -> bytes:
    z = instrument.sweeper.data
    return _encoded(instrument, seven_digits(pairs(z.real, z.imag)))


def _axis(instrument: Instrument, _: Unit) -> bytes:
    return _encoded(instrument, instrument.state.axis().values)


def _define(trace: int) -> Node:
    setting = Choice(tuple(PARAMETERS), "Z")
    return _own(f"CALCulate<Ch>:PARameter{trace}:DEFine", setting, f"PAR{trace}")


def _choose(trace: int) -> Node:
    def act(instrument: Instrument, _: Unit) -> None:
        instrument.scpi["trace"] = trace

    return Node(f"CALCulate<Ch>:PARameter{trace}:SELect", act)


# fixture compensation ------------------------------------------------------------------------------------------------


def _points(instrument: Instrument) -> Reals:
    """Return the frequencies of the standards: those of the sweep (USER), or fixed ones."""
    if instrument.scpi["points"] == "USER":
        return instrument.state.axis().frequency
    return np.geomspace(LOWEST_HZ, HIGHEST_HZ, 100)


def _acquire(standard: str) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        present = instrument.state.axis()
        frequency = _points(instrument)
        filled = {name: np.full(frequency.size, getattr(present, name)[0]) for name in vars(present)}
        axis = Axis(**{**filled, "values": frequency, "frequency": frequency})

        def done(_: Axis, z: Impedances) -> None:
            instrument.compensation.store(standard, frequency, z)

        instrument.sweeper.start(1, done, axis)

    return act


def _switched(standard: str) -> tuple[Act, Ask]:
    def act(instrument: Instrument, unit: Unit) -> None:
        instrument.compensation.switch(standard, Switch(False).parse(unit.arguments[0]))

    return act, lambda instrument, _: "1" if standard in instrument.compensation.on else "0"


def _as_impedance(standard: str, instrument: Instrument) -> Impedances:
    kept = instrument.compensation.measured.get(standard)
    if kept is None:
        raise CommandError(-230)
    return np.asarray(1 / kept if standard == "A" else kept, dtype=np.complex128)


def _read_standard(standard: str) -> Ask:
    def ask(instrument: Instrument, _: Unit) -> bytes:
        z = _as_impedance(standard, instrument)
        return _encoded(instrument, pairs(z.real, z.imag))

    return ask


def _write_standard(standard: str) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        frequency = _points(instrument)
        values = np.array([number(a) for a in unit.arguments])
        if values.size != 2 * frequency.size:
            raise CommandError(-220)
        instrument.compensation.put(standard, frequency, as_kept(standard, values[0::2] + 1j * values[1::2]))

    return act


def _standard(name: str, standard: str) -> list[Node]:
    act, ask = _switched(standard)
    at = f"SENSe<Ch>:CORRection2:ZMEasurement:{name}"
    return [
        Node(f"SENSe<Ch>:CORRection2:COLLect:ACQuire:{name}", _acquire(standard)),
        Node(f"SENSe<Ch>:CORRection2:{name}[:STATe]", act, ask, (1, 1)),
        Node(f"{at}:DATA", _write_standard(standard), _read_standard(standard), (2, 2 * POINTS)),
        Node(f"{at}:FREQuency", None, lambda i, _: _encoded(i, i.compensation.frequency.get(standard, np.zeros(0)))),
        Node(f"{at}:POINts", None, lambda i, _: f"+{i.compensation.frequency.get(standard, np.zeros(0)).size}"),
    ]


# all of it -----------------------------------------------------------------------------------------------------------


def _reset(continuous: bool) -> Act:
    def act(instrument: Instrument, _: Unit) -> None:
        instrument.reset(continuous=False)
        instrument.scpi["cont"] = continuous
        _rearm(instrument)

    return act


def _operation_complete(instrument: Instrument, _: Unit) -> None:
    if instrument.sweeper.seconds_left() > 0:
        instrument.opc_wanted = True
    else:
        instrument.status.raise_standard(OPC)


def _clear(instrument: Instrument, _: Unit) -> None:
    instrument.status.clear()
    instrument.opc_wanted = False


def _next_error(instrument: Instrument, _: Unit) -> str:
    error = instrument.status.next_error()
    return error if error.startswith("-") else f"+{error}"


def _bias(instrument: Instrument, unit: Unit) -> None:
    on = Switch(False).parse(unit.arguments[0])
    if on and instrument.bias_overload:
        raise CommandError(137)
    instrument.state.values["DCO"] = on


def _enable(header: str, name: str) -> Node:
    def act(instrument: Instrument, unit: Unit) -> None:
        setattr(instrument.status, name, Integer(0, 255, 0).parse(unit.arguments[0]))

    return Node(header, act, lambda i, _: f"+{getattr(i.status, name)}", (1, 1))


NODES = [
    Node("*IDN", None, lambda i, _: i.identity),
    Node("*OPT", None, lambda i, _: "120"),
    Node("*OPC", _operation_complete, lambda i, _: "+1"),
    Node("*WAI", lambda i, _: None),
    Node("*TRG", _trigger),
    Node("*RST", _reset(continuous=False)),
    Node("SYSTem:PRESet", _reset(continuous=True), None, (0, 1)),
    Node("*CLS", _clear),
    Node("*ESR", None, lambda i, _: f"+{i.status.take_standard()}"),
    Node("*STB", None, lambda i, _: f"+{i.status.byte()}"),
    _enable("*ESE", "standard_enable"),
    _enable("*SRE", "request_enable"),
    Node("SYSTem:ERRor[:NEXT]", None, _next_error),
    Node("STATus:OPERation:CONDition", None, _condition),
    _own("INITiate<Ch>:CONTinuous", Switch(False), "cont", _rearm),
    Node("INITiate<Ch>[:IMMediate]", _initiate),
    _own("TRIGger[:SEQuence]:SOURce", Choice(("INT", "EXT", "MAN", "BUS"), "INT"), "source", _rearm),
    Node("TRIGger[:SEQuence]:SINGle", _trigger),
    Node("TRIGger[:SEQuence][:IMMediate]", _trigger),
    _own("TRIGger[:SEQuence]:AVERage", Switch(False), "avertrig"),
    Node("ABORt", _abort),
    _edge(0),
    _edge(1),
    _value("SENSe<Ch>:FREQuency[:CW]", FREQUENCY, "CWFREQ"),
    Node("SENSe<Ch>:FREQuency:DATA", None, _axis),
    _value("SENSe<Ch>:SWEep:POINts", Integer(2, POINTS, 201), "POIN", axis=True),
    _own("SENSe<Ch>:SWEep:TYPE", Choice(("LIN", "LOG", "SEGM"), "LIN"), "type", _choose_type),
    _value("SENSe<Ch>:SWEep:DIRection", Choice(("UP", "DOWN"), "UP"), "SWED"),
    Node("SENSe<Ch>:SEGMent:DATA", _set_segments, _segments, (12, 9 + 3 * 201)),
    Node("SENSe<Ch>:SEGMent:SWEep:POINts", None, lambda i, _: f"+{sum(s.points for s in i.state.table.segments)}"),
    _value("SENSe<Ch>:APERture[:TIME]", Integer(1, 5, 1), "BWFACT"),
    _value("SENSe<Ch>:AVERage:COUNt", Integer(1, 999, 1), "PAVERFACT"),
    _value("SENSe<Ch>:AVERage[:STATe]", Switch(False), "PAVER"),
    _value("CALCulate<Ch>:AVERage:COUNt", Integer(1, 999, 16), "AVERFACT"),
    _value("CALCulate<Ch>:AVERage[:STATe]", Switch(False), "AVER"),
    Node("CALCulate<Ch>:AVERage:CLEar", _clear_average),
    _value("SOURce<Ch>:MODE", Choice(("VOLT", "CURR"), "VOLT"), "POWMOD"),
    _level("VOLT", 5e-3, 1.0),
    _level("CURR", 200e-6, 20e-3),
    _value("SOURce<Ch>:BIAS:MODE", Choice(("VOLT", "CURR"), "VOLT"), "DCMOD"),
    _value("SOURce<Ch>:BIAS:VOLTage[:LEVel]", Number(-40.0, 40.0, 0.0, "V", 1e-3), "DCV"),
    Node("SOURce<Ch>:BIAS:STATe", _bias, lambda i, _: "1" if i.state.on("DCO") else "0", (1, 1)),
    *(node for trace in range(1, 5) for node in (_define(trace), _choose(trace))),
    Node("CALCulate<Ch>[:SELected]:DATA:FDATa", None, _formatted),
    Node("CALCulate<Ch>[:SELected]:DATA:RDATa", None, _impedance),
    Node("CALCulate<Ch>[:SELected]:DATA:XAXis", None, _axis),
    _own("FORMat[:DATA]", Choice(("ASC", "REAL", "REAL32"), "ASC"), "form"),
    _own("FORMat:BORDer", Choice(("NORM", "SWAP"), "NORM"), "order"),
    _own("SENSe<Ch>:FIXTure:SELect", Choice(("NONE", "ARB", "FIXT16047"), "NONE"), "fixture"),
    _own("SENSe<Ch>:CORRection:COLLect:FPOints", Choice(("FIX", "USER"), "FIX"), "points"),
    *(node for name, standard in STANDARD_NAMES.items() for node in _standard(name, standard)),
]
"""All commands of the simulator; others give -113, as in the instrument."""

TREE = Tree(NODES)


def execute(instrument: Instrument, unit: Unit) -> bytes | None:
    """Carry out one unit and return its answer, None for a command. Errors go to the error queue."""
    instrument.advance()
    try:
        return TREE.entry(unit.mnemonic, unit.query)(instrument, unit)
    except CommandError as error:
        instrument.status.error(error)
        return None
    finally:
        instrument.advance()
        instrument.wake()


async def perform(instrument: Instrument, message: bytes, _: Callable[[], bool]) -> AsyncIterator[bytes]:
    """Carry out a program message; yield the answers one by one, without newlines."""
    try:
        for unit in parse(message):
            if unit.header in ("*OPC?", "*WAI"):
                await instrument.until_idle()
            answer = execute(instrument, unit)
            if answer is not None:
                yield answer
    except CommandError as error:
        instrument.status.error(error)
