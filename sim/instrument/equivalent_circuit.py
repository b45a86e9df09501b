"""Equivalent circuit analysis of the finished sweep (PM p.100-102): five circuits of three and four elements.

A: R1, C1 and L1 in parallel. B: C1 beside L1 and R1 in series. C: L1 in series with C0 beside R1. D: L1, C1 and R1 in
series. E: C0 beside L1, C1 and R1 in series. The instrument's own algorithm is not documented; here the circuit is
fitted to ln Z.
"""

from collections.abc import Callable, Mapping

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Impedances, Reals
from ..language.command_entry import Entry
from ..language.messages import CommandError, Unit
from .instrument import Instrument, Memory
from .search_range import searched

Values = Mapping[str, float]
"""R1 (ohm), L1 (H), C1 and C0 (F)."""


def _parallel(*impedances: Complexes | float) -> Complexes:
    return np.asarray(1 / sum((1 / z for z in impedances), start=np.complex128(0)), dtype=np.complex128)


CIRCUITS: Mapping[str, tuple[tuple[str, ...], Callable[[Complexes, Values], Complexes]]] = {
    "CIRA": (("R1", "L1", "C1"), lambda s, v: _parallel(v["R1"] + 0 * s, 1 / (s * v["C1"]), s * v["L1"])),
    "CIRB": (("R1", "L1", "C1"), lambda s, v: _parallel(1 / (s * v["C1"]), s * v["L1"] + v["R1"])),
    "CIRC": (("R1", "L1", "C0"), lambda s, v: s * v["L1"] + _parallel(1 / (s * v["C0"]), v["R1"] + 0 * s)),
    "CIRD": (("R1", "L1", "C1"), lambda s, v: s * v["L1"] + 1 / (s * v["C1"]) + v["R1"]),
    "CIRE": (
        ("R1", "L1", "C1", "C0"),
        lambda s, v: _parallel(1 / (s * v["C0"]), s * v["L1"] + 1 / (s * v["C1"]) + v["R1"]),
    ),
}
"""The elements of each circuit, and its impedance at s = j w."""


def impedance(circuit: str, frequency: Frequencies, values: Values) -> Impedances:
    """Return Z of a circuit, shape (N,)."""
    with np.errstate(all="ignore"):
        z = CIRCUITS[circuit][1](np.asarray(2j * np.pi * frequency, dtype=np.complex128), values)
    return np.asarray(np.nan_to_num(z), dtype=np.complex128)


def fitted(circuit: str, frequency: Frequencies, z: Impedances) -> Values:
    """Return the values of the circuit nearest to z (in ln Z). Raises CommandError (35) where there is none."""
    from scipy.optimize import (
        least_squares,
    )  # imported late: it takes a quarter of the simulator's start-up time, for a rare command

    names = CIRCUITS[circuit][0]
    start = np.array([_guess(circuit, frequency, z)[name] for name in names])
    if not np.all(np.isfinite(start)) or not np.all(start > 0):
        raise CommandError(35)

    def residual(logs: Reals) -> Reals:
        values = dict(zip(names, np.exp(logs).tolist(), strict=True))
        difference: Complexes = np.log(impedance(circuit, frequency, values) / z)
        return np.concatenate([difference.real, difference.imag])

    try:
        best = np.exp(least_squares(residual, np.log(start)).x)
    except ValueError:
        raise CommandError(35) from None
    return dict(zip(names, best.tolist(), strict=True))


def _guess(circuit: str, frequency: Frequencies, z: Impedances) -> Values:
    """Return start values: the resonance is where the real part of Y (for A to C: of Z) is largest."""
    w = 2 * np.pi * frequency
    seen: Complexes = 1 / z if circuit in ("CIRD", "CIRE") else z
    top = int(np.argmax(seen.real))
    width = float(np.ptp(w[seen.real >= seen.real[top] / 2])) or float(np.ptp(w)) or float(w[top])
    peak = max(abs(float(seen.real[top])), 1e-12)
    if circuit in ("CIRD", "CIRE"):
        inductance = 1 / (peak * width)
        series = float(1 / (w[top] ** 2 * inductance))
        shunt = max(float(np.median((1 / z).imag / w)), 1e-3 * series)
        return {"R1": 1 / peak, "L1": inductance, "C1": series, "C0": shunt}
    capacitance = 1 / (peak * width)
    inductance = float(1 / (w[top] ** 2 * capacitance))
    resistance = inductance * width if circuit == "CIRB" else peak
    return {"R1": resistance, "L1": inductance, "C1": capacitance, "C0": capacitance}


def _calculate(instrument: Instrument, _: Unit) -> None:
    """CALECPARA: fit the circuit over the marker search range."""
    state, sweeper = instrument.state, instrument.sweeper
    if state["SWPP"] != "FREQ":
        raise CommandError(131)
    within = searched(instrument, str(state["TRAC"]))
    if within.size < 3:
        raise CommandError(36)
    z = sweeper.data[within]
    if not np.all(z):
        raise CommandError(35)
    for name, value in fitted(str(state["EQUC"]), sweeper.axis.frequency[within], z).items():
        state.values[f"DEFEC{name}"] = value
    state.values["DISECPARA"] = True


def _simulate(instrument: Instrument, _: Unit) -> None:
    """SIMFCHAR: the circuit's impedance becomes the memory array."""
    state = instrument.state
    if state["SWPP"] != "FREQ":
        raise CommandError(131)
    axis = state.axis()
    values = {name: state.real(f"DEFEC{name}") for name in ("R1", "L1", "C1", "C0")}
    instrument.memory = Memory(axis, impedance(str(state["EQUC"]), axis.frequency, values))


EQUIVALENT_COMMANDS: Mapping[str, Entry] = {"CALECPARA": Entry(_calculate), "SIMFCHAR": Entry(_simulate)}
"""Commands by mnemonic."""
