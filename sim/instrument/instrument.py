"""The instrument: its parts and its time. `dialect` carries out program messages on it."""

import asyncio
import math
import time
from collections.abc import Callable
from dataclasses import dataclass

from ...models.base.arrays import Impedances
from ..bench.bench import Bench
from ..language.file_system import FileSystem
from .axis import Axis
from .correction import Correction
from .settings import RESTARTS_SWEEP, Value
from .state import State
from .status import OPC, POWER_ON, Status
from .sweep_run import Sweeper

SERIAL, FIRMWARE = "MY43202956", "REV1.11"

AXIS_SETTINGS = frozenset({"SWPP", "SWPT", "POIN", "STAR", "STOP", "CENT", "SPAN"})
"""Settings that change the axis, so that the data no longer fit."""


@dataclass(eq=False)
class Memory:
    """The memory arrays: a copy of the data array and the axis it was swept over."""

    axis: Axis
    data: Impedances


class Instrument:
    """A 4294A with a bench behind it. One event loop at a time."""

    def __init__(
        self, bench: Bench, time_scale: float = 1.0, clock: Callable[[], float] = time.monotonic, serial: str = SERIAL
    ) -> None:
        self.bench, self.time_scale, self.clock = bench, time_scale, clock
        self.identity = f"HEWLETT-PACKARD,4294A,{serial},{FIRMWARE}"
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
        self.calibration, self.compensation = Correction(), Correction()
        self.disk.power_off()
        self.memory: Memory | None = None
        self.opc_wanted = False
        self.sweeper = Sweeper(self.bench, self.state, self.status, self.clock, self.time_scale, self.corrected)
        self.reset(continuous=True)
        self.wake()

    def reset(self, continuous: bool) -> None:
        """`*RST` (HOLD) or `PRES` (CONT): settings to their defaults, data gone, corrections off."""
        self.state.reset()
        self.calibration.on.clear()
        self.compensation.on.clear()
        self.opc_wanted = False
        self.sweeper.hold()
        self.new_axis()
        if continuous:
            self.sweeper.start(-1)

    def corrected(self, axis: Axis, z: Impedances) -> Impedances:
        """Return the impedance after calibration and compensation of what the bridge measures."""
        z = self.calibration.apply(axis.frequency, z, self.state)
        return self.compensation.apply(axis.frequency, z, self.state)

    def set(self, mnemonic: str, argument: bytes) -> None:
        """Set one setting and everything that depends on it. Raises CommandError."""
        belongs_to_segment, before = self.state.table.edits(mnemonic), self._shape()
        self.state.set(mnemonic, argument)
        if not belongs_to_segment:
            self._after_change(mnemonic, before)

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

    # time --------------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        """Bring everything up to the clock."""
        self.sweeper.advance()
        if self.opc_wanted and self.sweeper.seconds_left() <= 0:
            self.opc_wanted = False
            self.status.raise_standard(OPC)

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

    async def changed_within(self, seconds: float) -> None:
        """Return when something changed, or after this time."""
        try:
            await asyncio.wait_for(self._changed.wait(), None if math.isinf(seconds) else seconds + 1e-4)
        except TimeoutError:
            return
