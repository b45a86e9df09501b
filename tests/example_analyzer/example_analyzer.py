"""An analyzer for pzctl: the ACME Z1000, which measures point by point. See docs/writing-an-analyzer.md."""

import re
from collections.abc import Callable

import numpy as np

from pzctl.drivers.base.analyzer import Analyzer, Cancelled, Identity, InstrumentError, Progress
from pzctl.drivers.base.capabilities import Capabilities
from pzctl.drivers.base.driver import InstrumentDriver
from pzctl.drivers.visa.connection import Connection
from pzctl.models.sweep import Sweep
from pzctl.models.sweep_plan import Segment, SweepPlan

IDN = re.compile(r"ACME,Z1000,(\w+),([\w.]+)")

CAPABILITIES = Capabilities(
    model="Z1000",
    frequency_Hz=(1e3, 10e6),
    oscillator_V=(0.01, 2.0),
    oscillator_A=None,
    bias_V=(0.0, 0.0),
    points_per_sweep=100_000,
    segments_per_sweep=1,
    bandwidths=(1, 2, 3, 4, 5),
    averages=1,
    delay_s=0.0,
    source_ohm=50.0,
    noise=lambda plan, f, Z: np.full(f.size, 1e-4 / plan.bandwidth),
    accuracy=lambda plan, f, Z: np.full(f.size, 2e-3) + np.abs(Z) / 1e7,
    points_seconds=lambda plan, f: 1e-3 * f.size,
    setup_seconds=0.1,
)


class Z1000(Analyzer):
    """`Z? f,V` measures at f Hz with V volts and answers `R,X` in ohm; there is no bias and no compensation."""

    capabilities = CAPABILITIES

    def __init__(self, link: Connection) -> None:
        self._link = link

    def identify(self) -> Identity:
        answer = self._link.ask("*IDN?").strip()
        found = IDN.fullmatch(answer)
        if not found:
            raise InstrumentError(f"{self._link.name}: the answer to *IDN? is {answer!r}; this is no ACME Z1000")
        return Identity(self._link.name, answer, "Z1000", found[1], found[2])

    def make_safe(self) -> None:
        """Nothing to switch off."""

    def measure(
        self,
        plan: SweepPlan,
        progress: Callable[[Progress], None] = lambda _: None,
        cancelled: Callable[[], bool] = lambda: False,
    ) -> tuple[Sweep, ...]:
        self.capabilities.check(plan)
        who, sweeps = self.identify(), list[Sweep]()
        axes = [_axis(segment) for segment in plan.segments]
        for k, axis in enumerate([np.concatenate(axes)] if plan.joined else axes):
            Z = np.empty(axis.size, np.complex128)
            for i, f in enumerate(axis):
                if cancelled():
                    raise Cancelled(f"{who.name}: cancelled at {f:g} Hz")
                Z[i] = complex(*map(float, self._link.ask(f"Z? {f:.6f},{plan.oscillator_V:g}").split(",")))
            settings = {"instrument": who.idn, "model": who.model, "serial": who.serial, "firmware": who.firmware}
            settings |= {"oscillator_V": plan.oscillator_V, "bandwidth": plan.bandwidth, "direction": "up"}
            settings |= {"source_ohm": self.capabilities.source_ohm}
            settings["noise_relative"] = self.capabilities.noise(plan, axis, Z).tolist()
            sweeps.append(Sweep(axis, Z, settings))
            progress(Progress((k + 1) / len(axes), 0.0, f"segment {k + 1}"))
        return tuple(sweeps)

    def close(self) -> None:
        self._link.close()


def _axis(segment: Segment) -> np.ndarray:
    space = np.geomspace if segment.spacing == "log" else np.linspace
    return space(segment.start_Hz, segment.stop_Hz, segment.points)


DRIVER = InstrumentDriver("ACME Z1000", IDN, capabilities=lambda idn: CAPABILITIES, open=Z1000)
