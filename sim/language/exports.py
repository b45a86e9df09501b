"""Files as the instrument writes them: ASCII export, Touchstone, binary arrays (reference 6.1, 6.2, 6.4)."""

import struct

import numpy as np

from ...models.base.arrays import Impedances, Reals
from ..instrument.axis import Axis
from ..instrument.instrument import FIRMWARE, Instrument
from ..instrument.traces import trace
from .messages import CommandError

TITLES = {
    "IMPH": "IMPEDANCE MAG PHASE (DEG)", "IRIM": "IMPEDANCE REAL IMAG", "LSR": "Ls-Rs", "LSQ": "Ls-Q",
    "CSR": "Cs-Rs", "CSQ": "Cs-Q", "CSD": "Cs-D", "AMPH": "ADMITTANCE MAG PHASE (DEG)",
    "ARIM": "ADMITTANCE REAL IMAG", "LPG": "Lp-G", "LPQ": "Lp-Q", "CPG": "Cp-G", "CPQ": "Cp-Q", "CPD": "Cp-D",
    "COMP": "COMPLEX Z-Y", "IMLS": "IMPEDANCE MAG-Ls", "IMCS": "IMPEDANCE MAG-Cs", "IMLP": "IMPEDANCE MAG-Lp",
    "IMCP": "IMPEDANCE MAG-Cp", "IMRS": "IMPEDANCE MAG-Rs", "IMQ": "IMPEDANCE MAG-Q", "IMD": "IMPEDANCE MAG-D",
    "LPR": "Lp-Rp", "CPR": "Cp-Rp",
}  # fmt: skip
"""MEASURE PARAMETER line by MEAS; the two magnitude/phase texts come from real exports, the others are ours."""

ADAPTERS = {"OFF": "NONE", "M1": "4TP 1M", "M2": "4TP 2M", "APC7": "7mm", "PROBE": "PROBE"}
AXIS_TITLES = {"FREQ": "Frequency", "OLEV": "Osc Level", "DCB": "DC Bias"}
SWEEPS = {"LIN": "LIN FREQ", "LOG": "LOG FREQ", "LIST": "LIST FREQ"}


def ascii_export(instrument: Instrument) -> bytes:
    """Return the file of SAVDASC: a header of 21 lines, trace A, 6 more lines, trace B."""
    lines = [*_header(instrument)]
    for which in "AB":
        lines += _trace_block(instrument, which)
    return "".join(line + "\r\n" for line in lines).encode("latin-1")


def _header(instrument: Instrument) -> list[str]:
    state = instrument.state
    sweep = SWEEPS[str(state["SWPT"])] if state["SWPP"] == "FREQ" else AXIS_TITLES[str(state["SWPP"])].upper()
    mode = str(state["POWMOD"])
    level = f"{state.levels[mode] * 1e3:4.0f} mVolt" if mode == "VOLT" else f"{state.levels[mode] * 1e6:4.0f} uAmp"
    bias = f"{state.real('DCV'):g} Volt" if state.on("DCO") else "OFF"
    return [
        f"4294A {FIRMWARE}",
        f'"DATE: {_date(instrument)}"',
        "",
        "",
        f'"MEASURE PARAMETER: {TITLES[str(state["MEAS"])]}"',
        f'"ADAPTER: {ADAPTERS[str(state["E4TP"])]}"',
        f'"SWEEP TYPE: {sweep}"',
        f'"NUMBER of POINTS: {instrument.sweeper.axis.values.size}"',
        f'"POINT DELAY TIME:  {state.real("PDELT"):g} Sec"',
        f'"SWEEP DELAY TIME:  {state.real("SDELT"):g} Sec"',
        f'"OSC LEVEL: {level}"',
        f'"DC BIAS: {bias}"',
        f'"BW: {state.count("BWFACT")}"',
        f'"SWEEP AVERAGING: {state.count("AVERFACT") if state.on("AVER") else "OFF"}"',
        f'"POINT AVERAGING: {state.count("PAVERFACT") if state.on("PAVER") else "OFF"}"',
    ]


def _date(instrument: Instrument) -> str:
    """Return the date; with a dead clock battery, the date that two real exports show."""
    return "    52 -100" if instrument.date_lost else instrument.date().strftime("%b %d %Y")


def _trace_block(instrument: Instrument, which: str) -> list[str]:
    state, axis = instrument.state, instrument.sweeper.axis
    columns = [f'"{AXIS_TITLES[str(state["SWPP"])]}"', '"Data Trace Real"', '"Data Trace Imag"']
    values = [*trace(axis.frequency, instrument.sweeper.data, str(state["MEAS"]), which)]
    if instrument.memory is not None:
        columns += ['"Memory Trace Real"', '"Memory Trace Imag"']
        values += trace(axis.frequency, instrument.memory.data, str(state["MEAS"]), which)
    form = "LOG" if instrument.formats[which] == "LOGY" else "LINEAR"
    rows = [
        "\t".join([f"{x:.11e}", *(f"{v:.6e}" for v in row)])
        for x, row in zip(axis.values, np.column_stack(values), strict=True)
    ]
    return ["", "", f'"TRACE: {which}"', f'"FORMAT: {form}"', "", "\t".join(columns), *rows]


def touchstone(axis: Axis, z: Impedances) -> bytes:
    """Return the file of SAVDS1P: kHz, magnitude and angle of S11 in 50 ohm. Raises CommandError for another axis."""
    if np.any(np.diff(axis.frequency) <= 0):
        raise CommandError(-221)
    s11 = (z - 50) / (z + 50)
    rows = zip(axis.frequency / 1e3, np.abs(s11), np.angle(s11, deg=True), strict=True)
    lines = ["#\tKHZ\tS\tMA\tR\t50", *(f"{f:.11e}\t{m:.11e}\t{a:.11e}" for f, m, a in rows)]
    return "".join(line + "\r\n" for line in lines).encode("ascii")


def binary_arrays(first: tuple[Reals, Reals], second: tuple[Reals, Reals]) -> bytes:
    """Return the file of SAVDDAT: 29 bytes, trace A as big-endian doubles, 10 bytes, trace B.

    The meaning of the 29 and the 10 bytes is not known; ours hold the number of points.
    """
    count = first[0].size
    head = struct.pack(">I", count).ljust(29, b"\0")
    a, b = (np.column_stack(part).astype(">f8").tobytes() for part in (first, second))
    return head + a + struct.pack(">I", count).ljust(10, b"\0") + b
