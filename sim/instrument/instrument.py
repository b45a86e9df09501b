"""The instrument: its parts and its clock. `dialect` carries out program messages on it."""

import asyncio
import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta

from ...models.base.arrays import Complexes, Frequencies, Impedances
from ..bench.bench import Bench
from ..language.file_system import FileSystem
from ..language.messages import CommandError
from .axis import Axis
from .correction import Correction
from .limit_lines import LimitTable, Tested, tested
from .markers import Markers, search
from .search_range import SearchBorders
from .settings import RESTARTS_SWEEP, Value
from .state import State
from .status import LIMIT_FAIL, OPC, POWER_ON, Status
from .sweep_run import Sweeper
from .trace_data import data_trace

SERIAL, FIRMWARE = "MY43202956", "REV1.11"

AXIS_SETTINGS = frozenset({"SWPP", "SWPT", "POIN", "STAR", "STOP", "CENT", "SPAN"})
"""Settings that change the axis; the data then no longer belong to it."""

PEAK_DX = {"FREQ": 500e3, "OLEV": 5e-3, "OLEV:A": 100e-6, "DCB": 0.4, "DCB:A": 1e-3}
"""Initial PKDLTX by sweep parameter: Hz, V, A (PM p.399)."""

TRACES: tuple[str, ...] = ("A", "B")


@dataclass(eq=False)
class Memory:
    """The memory arrays: a copy of the data array and the axis it was swept over."""

    axis: Axis
    data: Impedances


class Instrument:
    """A 4294A with a bench behind it. One event loop at a time."""

    def __init__(
        self,
        bench: Bench,
        time_scale: float = 1.0,
        clock: Callable[[], float] = time.monotonic,
        identity: str = f"HEWLETT-PACKARD,4294A,{SERIAL},{FIRMWARE}",
        set_initial: Callable[["Instrument"], None] = lambda _: None,
    ) -> None:
        self.bench, self.time_scale, self.clock = bench, time_scale, clock
        self.identity, self._set_initial = identity, set_initial
        self.scpi: dict[str, Value] = {}
        """Settings of an analyzer that speaks SCPI and that the 4294A does not have."""
        self.date_lost = False
        """Fault: the clock's battery is dead."""
        self.bias_overload = False
        """Fault: DCO ON answers with error 137."""
        self.no_list = False
        """Fault: the commands that edit the list-sweep table are unknown."""
        self.disk = FileSystem()
        self._changed = asyncio.Event()
        self.power_on()

    def power_on(self) -> None:
        """Start as after switching on: RAM empty, power-on bit set, sweeping as after PRES."""
        self.state, self.status = State(), Status(standard=POWER_ON)
        self._reset_screen()
        self.calibration, self.compensation = Correction(prefix="DCAL"), Correction()
        self.calibrating: dict[str, tuple[Frequencies, Complexes]] = {}
        """Standards of the user calibration that are measured and not in force yet (CALDON)."""
        self.adapter_steps: set[str] = set()
        """Steps of the adapter's set-up that are done (ECALP, ECALA ...)."""
        self.disk.power_off()
        self.memory: Memory | None = None
        self.opc_wanted = False
        self.clock_offset = timedelta()
        """Offset of the clock, set by SETCDATE and SETCTIME."""
        self.program: dict[str, bytes] = {}
        """What was sent to the built-in BASIC, by mnemonic."""
        self.sweeper = Sweeper(self.bench, self.state, self.status, self.clock, self.time_scale, self.corrected)
        self.reset(continuous=True)
        self.wake()

    def reset(self, continuous: bool) -> None:
        """`*RST` (HOLD) or `PRES` (CONT): settings to their defaults, data gone, corrections off."""
        if self.state["CALP"] == "USER":
            self.drop_corrections()
        self.state.reset()
        self._reset_screen()
        self.calibration.on.clear()
        self.compensation.on.clear()
        self.calibrating.clear()
        self.adapter_steps.clear()
        self.opc_wanted = False
        self.sweeper.hold()
        self.new_axis()
        self._set_initial(self)
        if continuous:
            self.sweeper.start(-1)

    def _reset_screen(self) -> None:
        """Bring markers, limits, formats and scales to their initial values."""
        self.markers = {trace: Markers() for trace in TRACES}
        self.borders = {trace: SearchBorders() for trace in TRACES}
        self.peak_dx = dict.fromkeys(TRACES, PEAK_DX["FREQ"])
        self.limits = {trace: LimitTable() for trace in TRACES}
        self.display = dict.fromkeys(TRACES, "DATA")
        """DISP of each trace."""
        self.formats = dict.fromkeys(TRACES, "LINY")
        """FMT of each trace."""
        self.scale: dict[tuple[str, str, str], float] = {}
        """What was set of the Y axes, by trace, quantity and mnemonic."""
        self.threshold = 0.0
        """THRR."""
        self.peaks_left: dict[str, list[int]] = {}
        """Points that NEXPK? and NEXNPK? have not returned yet."""
        self.numbers: dict[str, float] = {"PORTZ": 0.0, "PORE": 0.0}

    def drop_corrections(self) -> bool:
        """Delete the coefficients of calibration and compensation; return whether there were any."""
        lost = [correction.drop() for correction in (self.calibration, self.compensation)]
        return any(lost)

    def corrected(self, axis: Axis, z: Impedances) -> Impedances:
        """Return the bridge's reading after calibration and compensation."""
        z = self.calibration.apply(axis.frequency, z, self.state)
        return self.compensation.apply(axis.frequency, z, self.state)

    def set(self, mnemonic: str, argument: bytes) -> None:
        """Set one setting and everything that depends on it. Raises CommandError."""
        belongs_to_segment, before = self.state.table.edits(mnemonic), self._shape()
        points, swept, measurement = self.state["CALP"], self.state.swept, self.state["MEAS"]
        self.state.set(mnemonic, argument)
        if belongs_to_segment:
            return
        if self.state.swept != swept:
            self.peak_dx = dict.fromkeys(TRACES, PEAK_DX[self.state.swept])
        if self.state["MEAS"] != measurement:
            complex_plane = self.state["MEAS"] == "COMP"
            self.formats = dict.fromkeys(TRACES, "COMP" if complex_plane else "LINY")
            self.sweeper.written = {}
        changed = self._shape() != before
        self._after_change(mnemonic, before)
        if (self.state["CALP"] != points or (changed and points == "USER")) and self.drop_corrections():
            raise CommandError(13)

    def _shape(self) -> tuple[Value | tuple[float, float], ...]:
        return self.state["SWPP"], self.state["SWPT"], self.state["POIN"], *self.state.edges.values()

    def _after_change(self, mnemonic: str, before: tuple[Value | tuple[float, float], ...]) -> None:
        if mnemonic not in RESTARTS_SWEEP:
            return
        if mnemonic in AXIS_SETTINGS and self._shape() != before:
            self.new_axis()
        self.sweeper.restart()

    def new_axis(self) -> None:
        """Drop data and memory, because they belong to another axis."""
        self.sweeper.forget()
        self.memory = None
        for borders in self.borders.values():
            borders.analysis = borders.analysis_segment = None

    def date(self) -> datetime:
        """Return date and time by the instrument's own clock."""
        return datetime.now(UTC) + self.clock_offset

    # time --------------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Bring everything up to the clock."""
        self.sweeper.advance()
        if self.sweeper.finished:
            self.sweeper.finished = False
            self._after_sweep()
        if self.opc_wanted and self.sweeper.seconds_left() <= 0:
            self.opc_wanted = False
            self.status.raise_standard(OPC)

    def _after_sweep(self) -> None:
        """Test the limits and repeat the marker search, where they are switched on."""
        active = self.state["TRAC"]
        for trace in TRACES:
            self.state.values["TRAC"] = trace
            if self.state.of_trace("LIMITEST") and (limit_result(self, trace).result == 0).any():
                self.status.raise_instrument(LIMIT_FAIL[trace])
            if self.state.of_trace("TRACK") and self.markers[trace].search != "OFF":
                search(self, self.markers[trace].search)
        self.state.values["TRAC"] = active

    def wake(self) -> None:
        """Wake the waiting tasks, because something may have changed."""
        changed, self._changed = self._changed, asyncio.Event()
        changed.set()

    async def until_idle(self) -> None:
        """Return when no overlapped operation is pending."""
        self.advance()
        while (left := self.sweeper.seconds_left()) > 0:
            await self.changed_within(left)
            self.advance()

    async def until_standard_measured(self) -> None:
        """Return when no standard is being measured: later commands wait for such a measurement."""
        self.advance()
        while self.sweeper.measures_standard:
            await self.changed_within(self.sweeper.seconds_left())
            self.advance()

    async def changed_within(self, seconds: float) -> None:
        """Return when something changed, or after this time."""
        try:
            await asyncio.wait_for(self._changed.wait(), None if math.isinf(seconds) else seconds + 1e-4)
        except TimeoutError:
            return


def limit_result(instrument: Instrument, trace: str) -> Tested:
    """Test the data trace against its limit lines."""
    state, x = instrument.state, instrument.sweeper.axis.values
    shifts = float(state.of_trace("LIMIPRMO", trace)), float(state.of_trace("LIMIAMPO", trace))
    return tested(instrument.limits[trace].segments, x, data_trace(instrument, trace)[0], *shifts)
