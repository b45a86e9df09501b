"""The present settings: values by mnemonic, those whose range depends on others, and the list-sweep table."""

from dataclasses import dataclass, field

from ..language.messages import CommandError
from .axis import Axis, ListSegment, limits, list_axis, moved_edges, plain_axis
from .list_table import EDGES, ListTable, edge
from .settings import PER_TRACE, TABLE, Number, Setting, Value


@dataclass
class State:
    """Every setting that `*RST` resets."""

    values: dict[str, Value] = field(default_factory=dict[str, Value])
    edges: dict[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]])
    """START and STOP by sweep parameter (Hz, V)."""
    levels: dict[str, float] = field(default_factory=dict[str, float])
    """Oscillator level by POWMOD (V, A)."""
    form: int = 4
    table: ListTable = field(default_factory=ListTable)
    """Of the list sweep."""
    circuit: tuple[float, ...] = (0.0, 0.0, 0.0, 0.0)
    """R1, L1, C1, C0 of the equivalent circuit, SI."""

    def __post_init__(self) -> None:
        self.reset()

    def reset(self) -> None:
        """Set every setting to its default."""
        self.values = {name: setting.default for name, setting in TABLE.items() if name not in PER_TRACE}
        self.values |= {f"{name}:{trace}": TABLE[name].default for name in PER_TRACE for trace in "AB"}
        self.edges = {
            p: (limits("STAR", p, "LIN").default, limits("STOP", p, "LIN").default) for p in ("FREQ", "OLEV", "DCB")
        }
        self.levels = {"VOLT": 0.5, "CURR": 200e-6}
        self.form, self.table = 4, ListTable()
        self.circuit = (0.0, 0.0, 0.0, 0.0)

    def __getitem__(self, mnemonic: str) -> Value:
        return self.values[mnemonic]

    def count(self, mnemonic: str) -> int:
        """Return a whole-number setting."""
        return int(self.values[mnemonic])

    def real(self, mnemonic: str) -> float:
        """Return a numeric setting."""
        return float(self.values[mnemonic])

    def on(self, mnemonic: str) -> bool:
        """Return a switch."""
        return bool(self.values[mnemonic])

    def knows(self, mnemonic: str) -> bool:
        """Return whether this mnemonic is a setting."""
        return mnemonic in TABLE or mnemonic in EDGES or mnemonic == "POWE"

    def set(self, mnemonic: str, argument: bytes) -> None:
        """Set one setting; numbers are clamped. Raises CommandError for what cannot be read or is not possible."""
        if self.table.edits(mnemonic):
            self.table.set(mnemonic, argument, self._level_kind())
        elif mnemonic in EDGES:
            parameter = str(self["SWPP"])
            self.edges[parameter] = moved_edges(mnemonic, argument, *self.edges[parameter], self._edge_kind(mnemonic))
            self._keep_in_limits()
        elif mnemonic == "POWE":
            self.levels[str(self["POWMOD"])] = self._level_kind().parse(argument)
        else:
            value = TABLE[mnemonic].parse(argument)
            self._refuse_conflict(mnemonic, value)
            self.values[self._key(mnemonic)] = value
            if mnemonic in ("SWPT", "SWPP"):
                self._keep_in_limits()

    def _refuse_conflict(self, mnemonic: str, value: Value) -> None:
        frequency_only = (mnemonic == "SWPT" and value != "LIN" and self["SWPP"] != "FREQ") or (
            mnemonic == "SWPP" and value != "FREQ" and self["SWPT"] != "LIN"
        )
        if frequency_only:
            raise CommandError(-221, "SETTINGS CONFLICT")
        if mnemonic == "SWPT" and value == "LIST" and not self.table.segments:
            raise CommandError(-221, "SETTINGS CONFLICT; LIST TABLE IS EMPTY")

    def query(self, mnemonic: str) -> str:
        """Return the reply to the query of a setting; while a segment is edited, the value of that segment."""
        if self.table.edits(mnemonic):
            return self.table.query(mnemonic, self._level_kind())
        if mnemonic in EDGES:
            return Number(0, 0, 0, "HZ" if self["SWPP"] == "FREQ" else "V").answer(self._edge_value(mnemonic))
        if mnemonic == "POWE":
            return self._level_kind().answer(self.levels[str(self["POWMOD"])])
        if mnemonic == "POIN" and self["SWPT"] == "LIST":
            return str(sum(s.points for s in self.table.segments))
        setting: Setting = TABLE[mnemonic]
        return setting.answer(self.values[self._key(mnemonic)])

    def _key(self, mnemonic: str) -> str:
        return f"{mnemonic}:{self['TRAC']}" if mnemonic in PER_TRACE else mnemonic

    def _edge_value(self, mnemonic: str) -> float:
        if self["SWPT"] == "LIST":
            start, stop = self.table.segments[0].start, self.table.segments[-1].stop
        else:
            start, stop = self.edges[str(self["SWPP"])]
        return edge(mnemonic, start, stop)

    def _edge_kind(self, mnemonic: str) -> Number:
        edge = mnemonic if mnemonic in ("STAR", "STOP") else "STAR"
        return limits(edge, str(self["SWPP"]), str(self["SWPT"]))

    def _level_kind(self) -> Number:
        if self["POWMOD"] == "VOLT":
            return Number(5e-3, 1.0, 0.5, "V", 1e-3)
        return Number(200e-6, 20e-3, 200e-6, "A", 20e-6)

    def _keep_in_limits(self) -> None:
        """Clamp START and STOP to what the sweep parameter and type allow."""
        parameter, kind = str(self["SWPP"]), str(self["SWPT"])
        start, stop = (
            min(max(value, kind_of.low), kind_of.high)
            for value, kind_of in zip(
                self.edges[parameter], (limits(e, parameter, kind) for e in ("STAR", "STOP")), strict=True
            )
        )
        self.edges[parameter] = (start, stop)

    def begin_segment(self, at: int | None = None) -> None:
        """Open a segment of the list-sweep table for editing; see `ListTable.begin`. Raises CommandError."""
        level = self.levels[str(self["POWMOD"])]
        self.table.begin(ListSegment(*self.edges["FREQ"], 2, self.count("BWFACT"), level, self.real("DCV"), 1), at)

    def axis(self) -> Axis:
        """Return the axis of the sweep that is set up. Raises CommandError for an empty list-sweep table."""
        if self["SWPT"] == "LIST":
            return list_axis(tuple(self.table.segments))
        parameter = str(self["SWPP"])
        start, stop = self.edges[parameter]
        return plain_axis(
            parameter=parameter,
            kind=str(self["SWPT"]),
            start=start,
            stop=stop,
            points=self.count("POIN"),
            fixed_frequency=self.real("CWFREQ"),
            level=self.levels[str(self["POWMOD"])],
            bandwidth=self.count("BWFACT"),
            point_average=self.count("PAVERFACT") if self.on("PAVER") else 1,
        )
