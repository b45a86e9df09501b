"""Equivalent circuit analysis of the finished sweep (OM p.249): the four-element circuit E of a resonator.

Circuit E is C0 beside R1, L1 and C1 in series. What the three-element circuits A to D are is not in our sources: they
can be selected, and calculating them is refused. `EQUC?` and the names of the parameters are seen in use; that
CALECPARA calculates is the family's name for it [the 4395A's; no 4294A source].
"""

from collections.abc import Mapping

import numpy as np

from ...models.base.arrays import Complexes, Frequencies, Impedances, Reals
from ..language.command_entry import Act, Ask, Entry
from ..language.messages import CommandError, Unit
from .instrument import Instrument
from .settings import number

PARAMETERS = ("R1", "L1", "C1", "C0")
"""ohm, H, F, F."""


def impedance(frequency: Frequencies, values: Reals) -> Impedances:
    """Return Z of circuit E, shape (N,), for R1, L1, C1 and C0."""
    R1, L1, C1, C0 = (float(value) for value in values)
    jw = 2j * np.pi * frequency
    return np.asarray(1 / (jw * C0 + 1 / (R1 + jw * L1 + 1 / (jw * C1))), dtype=np.complex128)


def fitted(frequency: Frequencies, z: Impedances) -> Reals:
    """Return R1, L1, C1 and C0 of the circuit nearest to z (in ln Z), starting from the strongest resonance.

    Raises CommandError where there is none.
    """
    from scipy.optimize import least_squares  # a quarter of the simulator's start, for a command that is rare

    y: Complexes = 1 / z
    w = 2 * np.pi * frequency
    top = int(np.argmax(y.real))
    above = w[y.real >= y.real[top] / 2]
    width = float(np.ptp(above)) if above.size else 0.0
    C0 = float(np.median(y.imag / w))
    if not (0 < top < z.size - 1 and width > 0 and y.real[top] > 0 and C0 > 0):
        raise CommandError(-221, "SETTINGS CONFLICT; NO RESONANCE IN THE SWEEP")
    R1 = 1 / float(y.real[top])
    L1 = R1 / width
    start = np.array([R1, L1, 1 / (w[top] ** 2 * L1), C0])

    def residual(logs: Reals) -> Reals:
        difference: Complexes = np.log(impedance(frequency, np.exp(logs)) / z)
        return np.concatenate([difference.real, difference.imag])

    try:
        return np.asarray(np.exp(least_squares(residual, np.log(start)).x), dtype=np.float64)
    except ValueError:
        raise CommandError(-221, "SETTINGS CONFLICT; NO RESONANCE IN THE SWEEP") from None


def _calculate(instrument: Instrument, _: Unit) -> None:
    if instrument.state["EQUC"] != "CIRE":
        raise CommandError(-221, "SETTINGS CONFLICT; EQUC CIRE FIRST")
    sweeper = instrument.sweeper
    if not np.all(sweeper.data):
        raise CommandError(-230, "DATA CORRUPT OR STALE")
    instrument.state.circuit = tuple(fitted(sweeper.axis.frequency, sweeper.data).tolist())


def _define(k: int) -> Act:
    def act(instrument: Instrument, unit: Unit) -> None:
        circuit = list(instrument.state.circuit)
        circuit[k] = number(unit.arguments[0])
        instrument.state.circuit = tuple(circuit)

    return act


def _defined(k: int) -> Ask:
    return lambda instrument, _: f"{instrument.state.circuit[k]:+.6E}"


EQUIVALENT_COMMANDS: Mapping[str, Entry] = {
    "CALECPARA": Entry(_calculate),
    **{f"DEFEC{name}": Entry(_define(k), 1, 1) for k, name in enumerate(PARAMETERS)},
}
"""Commands by mnemonic."""

EQUIVALENT_QUERIES: Mapping[str, Entry] = {f"DEFEC{name}": Entry(_defined(k)) for k, name in enumerate(PARAMETERS)}
"""Queries by mnemonic, without the question mark."""
