"""The present settings: values by mnemonic, those whose range depends on others, and the list-sweep table."""

from dataclasses import dataclass, field

from ..language.command_table import ROWS
from ..language.messages import CommandError
from .axis import RANGES, Axis, ListSegment, limits, list_axis, moved_edges, plain_axis
from .list_table import EDGES, ListTable, edge, level_kind
from .settings import KEPT, PER_ITEM, PER_TRACE, SCREEN_ITEMS, TABLE, Number, Setting, Value

PARAMETERS = ("FREQ", *RANGES)
"""What is swept: SWPP, with `:A` where level or bias are swept in ampere."""


def _initial() -> dict[str, Value]:
    """Return every setting's initial value, by mnemonic, and by mnemonic and trace or screen item."""
    values: dict[str, Value] = {}
    for name, setting in TABLE.items():
        owners = "AB" if name in PER_TRACE else SCREEN_ITEMS if name in PER_ITEM else ()
        values |= {f"{name}:{owner}": setting.default for owner in owners} or {name: setting.default}
    return values


@dataclass
class State:
    """Every setting that `*RST` resets, and those that it keeps."""

    values: dict[str, Value] = field(default_factory=_initial)
    edges: dict[str, tuple[float, float]] = field(default_factory=dict[str, tuple[float, float]])
    """START and STOP by what is swept (Hz, V, A)."""
    types: dict[str, str] = field(default_factory=dict[str, str])
    """SWPT of the sweep parameters that are not swept at present."""
    levels: dict[str, float] = field(default_factory=dict[str, float])
    """Oscillator level by POWMOD (V, A)."""
    radios: dict[str, bool] = field(default_factory=dict[str, bool])
    """Which of a group of exclusive commands was given last."""
    form: int = 4
    table: ListTable = field(default_factory=ListTable)
    """The table of the list sweep."""

    def __post_init__(self) -> None:
        self.radios = {name: row.initial == "1" for name, row in ROWS.items() if row.kind == "radio"}
        self.reset()

    def reset(self) -> None:
        """Set every setting to its default, except those that a preset keeps."""
        self.values = _initial() | {name: self.values[name] for name in KEPT}
        self.edges = {p: (limits("STAR", p, "LIN").default, limits("STOP", p, "LIN").default) for p in PARAMETERS}
        self.types = {}
        self.levels = {mode: level_kind(mode).default for mode in ("VOLT", "CURR")}
        self.form, self.table = 4, ListTable()
        self.radios |= {"ANAODATA": True, "ANAOMEMO": False}

    @property
    def swept(self) -> str:
        """What is swept: one of PARAMETERS."""
        parameter = str(self["SWPP"])
        in_ampere = {"OLEV": self["POWMOD"] == "CURR", "DCB": str(self["DCMOD"]).endswith("CURR")}
        return parameter + (":A" if in_ampere.get(parameter) else "")

    def of_trace(self, mnemonic: str, trace: str | None = None) -> Value:
        """Return a setting of a trace, of the active one unless one is given."""
        return self.values[f"{mnemonic}:{trace or self['TRAC']}"]

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
        """Set one setting; numbers are clamped. Raises CommandError for an unreadable or impossible value."""
        if self.table.edits(mnemonic):
            self.table.set(mnemonic, argument, self.swept)
        elif mnemonic in EDGES:
            parameter = self.swept
            self.edges[parameter] = moved_edges(mnemonic, argument, *self.edges[parameter], self._edge_kind(mnemonic))
            self._keep_in_limits()
        elif mnemonic == "POWE":
            self.levels[str(self["POWMOD"])] = level_kind(str(self["POWMOD"])).parse(argument)
        else:
            value = TABLE[mnemonic].parse(argument)
            self._refuse_conflict(mnemonic, value)
            if mnemonic == "SWPP":  # each sweep parameter keeps its own sweep type (PM p.39)
                self.types[str(self["SWPP"])] = str(self["SWPT"])
                self.values["SWPT"] = self.types.get(str(value), "LIN")
            self.values[self._key(mnemonic)] = value
            if mnemonic in ("SWPT", "SWPP", "POWMOD", "DCMOD"):
                self._keep_in_limits()

    def _refuse_conflict(self, mnemonic: str, value: Value) -> None:
        if mnemonic == "SWPT" and value == "LOG" and self["SWPP"] != "FREQ":
            raise CommandError(131)
        if mnemonic == "SWPT" and value == "LIST" and not self.table.segments:
            raise CommandError(124)

    def query(self, mnemonic: str) -> str:
        """Return the reply to the query of a setting; while a segment is edited, the value of that segment."""
        if self.table.edits(mnemonic):
            return self.table.query(mnemonic)
        if mnemonic in EDGES:
            return Number(0, 0, 0).answer(self._edge_value(mnemonic))
        if mnemonic == "POWE":
            return level_kind(str(self["POWMOD"])).answer(self.levels[str(self["POWMOD"])])
        if mnemonic == "POIN" and self["SWPT"] == "LIST":
            return str(sum(s.points for s in self.table.segments))
        setting: Setting = TABLE[mnemonic]
        return setting.answer(self.values[self._key(mnemonic)])

    def _key(self, mnemonic: str) -> str:
        owner = self["TRAC"] if mnemonic in PER_TRACE else self["COLO"] if mnemonic in PER_ITEM else ""
        return f"{mnemonic}:{owner}" if owner else mnemonic

    def _edge_value(self, mnemonic: str) -> float:
        if self["SWPT"] == "LIST":
            start, stop = self.table.segments[0].start, self.table.segments[-1].stop
        else:
            start, stop = self.edges[self.swept]
        return edge(mnemonic, start, stop)

    def _edge_kind(self, mnemonic: str) -> Number:
        edge = mnemonic if mnemonic in ("STAR", "STOP") else "STAR"
        return limits(edge, self.swept, str(self["SWPT"]))

    def _keep_in_limits(self) -> None:
        """Clamp START and STOP to the range of the sweep parameter and type."""
        parameter, kind = self.swept, str(self["SWPT"])
        start, stop = (
            min(max(value, kind_of.low), kind_of.high)
            for value, kind_of in zip(
                self.edges[parameter], (limits(e, parameter, kind) for e in ("STAR", "STOP")), strict=True
            )
        )
        self.edges[parameter] = (start, stop)

    def first_segment(self) -> ListSegment:
        """Return the segment that a new list-sweep table begins with (PM p.415)."""
        start, _ = self.edges[self.swept]
        mode = str(self["POWMOD"])
        return ListSegment(
            start,
            start,
            201,
            self.count("BWFACT"),
            self.levels[mode],
            self.real("DCV"),
            1,
            mode,
            str(self["DCMOD"]),
            self.real("DCI"),
        )

    def axis(self) -> Axis:
        """Return the axis of the sweep that is set up. Raises CommandError for an empty list-sweep table."""
        if self["SWPT"] == "LIST":
            return list_axis(tuple(self.table.segments), self.swept, self.real("CWFREQ"))
        parameter = self.swept
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
